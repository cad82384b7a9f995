"""A hook of mkdocs: the README and CONTRIBUTING.md as pages of the site, their links as those of a page."""

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

# Files at the top, and the pages that they are.
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md"}
# What those pages link to, beside pages.
LINKED = ("LICENSE", "examples/*.py", "examples/extensions/*/*.py")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The files of docs/, and those at the top that belong to the site."""
    top = Path(config.config_file_path).parent
    for source, page in PAGES.items():
        text = (top / source).read_text(encoding="utf-8").replace("](docs/", "](")
        for other, target in PAGES.items():
            text = text.replace(f"]({other})", f"]({target})")
        files.append(File.generated(config, page, content=text))
    for pattern in LINKED:
        for path in sorted(top.glob(pattern)):
            files.append(File.generated(config, path.relative_to(top).as_posix(), abs_src_path=str(path)))
    return files
