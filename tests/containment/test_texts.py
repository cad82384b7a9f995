"""YAML and JSON of strangers: bounded, and everything that is no value is one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from identification.errors import InputError
from testbench.files import read_json
from testbench.yaml_file import read_fields

BOMB = "a: &a [0,0,0,0,0,0,0,0,0,0]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]\n"
    for before, name in zip("abcdefg", "bcdefgh", strict=True)
)
YAML = {
    "aliases of aliases": (BOMB, "over 20000 values"),
    "a value in itself": ("a: &a [*a]", "holds itself"),
    "a mapping in itself": ("a: &a {b: *a}", "holds itself"),
    "depth": (f"a: {'[' * 5000}{']' * 5000}", "levels of nesting"),
    "a tag that does not fit": ("a: !!int x", "invalid literal"),
    "a python object": ("a: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
    "digits": (f"a: {'9' * 5000}", "digits"),
    "hexadecimal digits": (f"a: 0x{'f' * 5000}", "digits"),
    "no number": ("a: .nan", "a: expected a finite number"),
    "an infinite number": ("a: [1, -.inf]", "a.1: expected a finite number"),
    "bytes": ("a: !!binary QUJD", "a number or a text"),
    "a set": ("a: !!set {b, c}", "a number or a text"),
    "a key twice": ("a: 1\na: 2", "every key once"),
    "a key that is a list": ("[1, 2]: 3", "unhashable key"),
    "a merge of nothing": ("<<: 3\na: 1", "expected a mapping"),
    "a control character": ('a: "\\e[2J"', "printable characters"),
    "no UTF-8": ("a: \udcff", "utf-8"),
    "two documents": ("a: 1\n---\na: 2", "single document"),
    "nothing": ("", "a mapping of fields"),
    "length": ("a: " + "x" * (1 << 19), "at most 256 KiB"),
}
JSON = {
    "depth": ("[" * 100_000, "nested lists"),
    "some depth": ("[" * 100 + "]" * 100, "nested lists"),
    "digits": ("9" * 5000, "5000 digits"),
    "no number": ('{"a": NaN}', "NaN"),
    "an infinite number": ('{"a": -Infinity}', "Infinity"),
    "a number beyond double precision": ("[1e400]", "beyond double precision"),
    "a key twice": ('{"a": 1, "a": 2}', "the key 'a' twice"),
    "half a character": ('["\\ud800"]', "surrogates"),
    "no UTF-8": ('"\udcff"', "utf-8"),
    "nothing": ("", "Expecting value"),
}


def complaint(read: Callable[[Path], Any], path: Path, text: str) -> str:
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError) as error:
        read(path)
    line = str(error.value)
    assert line.startswith(f"{path}: ")
    assert line.isprintable()
    return line


@pytest.mark.parametrize("kind", YAML)
def test_bad_yaml_is_one_line(kind: str, tmp_path: Path) -> None:
    text, says = YAML[kind]
    assert says in complaint(read_fields, tmp_path / "scenario.yaml", text)


@pytest.mark.parametrize("kind", JSON)
def test_bad_json_is_one_line(kind: str, tmp_path: Path) -> None:
    text, says = JSON[kind]
    assert says in complaint(read_json, tmp_path / "document.json", text)


def test_a_date_is_the_text_that_it_is(tmp_path: Path) -> None:
    (tmp_path / "scenario.yaml").write_text("a: 2024-99-99\nb: &b [1, 2]\nc: *b\n")
    assert read_fields(tmp_path / "scenario.yaml") == {"a": "2024-99-99", "b": [1, 2], "c": [1, 2]}
