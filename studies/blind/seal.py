"""The manifest of sealed cases: every file and its hash, so that answers cannot change behind diagnoses."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identification.errors import InputError
from testbench.containment.shape import inside, require_shape
from testbench.files import read_json, write_json

from ..document_shapes import Answers, Manifest
from .case import CASES, SEALED, places

MANIFEST, ANSWERS = "manifest.json", "answers.json"
FORMAT, VERSION = "blind-cases", 1


def seal(out: Path, names: Sequence[str]) -> None:
    """Gather the answers of all cases into sealed/answers.json and write manifest.json over every file."""
    answers = [read_json(places(out, name).answer) for name in names]
    write_json(
        {"format": "blind-answers", "format_version": VERSION, "answers": answers}, out / SEALED / ANSWERS
    )
    for name in names:
        places(out, name).answer.unlink()
    files = sorted(path for folder in (CASES, SEALED) for path in (out / folder).rglob("*") if path.is_file())
    manifest = {
        "format": FORMAT,
        "format_version": VERSION,
        "cases": list(names),
        "sha256": {path.relative_to(out).as_posix(): _hash(path) for path in files},
    }
    write_json(manifest, out / MANIFEST)


def opened(out: Path) -> list[dict[str, Any]]:
    """The answers, once every file is what the manifest says. Raises InputError where one is not."""
    manifest = read_json(out / MANIFEST)
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(out / MANIFEST, "format", FORMAT, "something else")
    require_shape(out / MANIFEST, Manifest, manifest)
    for name, expected in manifest["sha256"].items():
        path = inside(out, name, out / MANIFEST, "sha256")
        if not path.is_file():
            raise InputError(path, "sealed file", "the file of the manifest", "no such file")
        found = _hash(path)
        if found != expected:
            raise InputError(path, "sha256", expected, found)
    answers = require_shape(out / SEALED / ANSWERS, Answers, read_json(out / SEALED / ANSWERS))
    return answers["answers"]


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
