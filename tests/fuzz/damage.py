"""Damage to a file, drawn by seed: bytes of any, and words and values of those that are text."""

import re

import numpy as np

# What stands in place of a value, or of a word.
STRANGE = (
    *(b"nan", b"-inf", b"1e400", b"-1", b"0", b"9" * 60, b"1e-320", b"null", b"true", b"[]", b"{}", b'""'),
    *(b"..", b"[/x]", b"\xff\xfe", b"\x00", b"\x1b[2J", b"x" * 5000, b"&a [*a]", b"!!int x", b"2024-99-99"),
    *(b"../../etc/passwd", b"/dev/zero", b'"\\ud800"', b"[" * 400),
    *(b"<include file='/dev/zero'/>", b"<replicate count='9999999'>"),
)
WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*|-?[0-9.]+(?:[eE][-+]?[0-9]+)?")


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """The content with one to four changes."""
    is_text = b"\x00" not in content
    for _ in range(int(random.integers(1, 5))):
        # Of text mostly words and values: what is no text any more is soon refused.
        kind = int(random.integers(0, 5) if not is_text or random.random() < 0.2 else random.integers(5, 7))
        content = _changed(content, kind, random)
    return content


def _changed(content: bytes, kind: int, random: np.random.Generator) -> bytes:
    data = bytearray(content or b" ")
    at = int(random.integers(0, len(data)))
    size = int(random.integers(1, 33))
    if kind == 0:
        data[at] = int(random.integers(0, 256))
    elif kind == 1:
        data[at : at + size] = bytes(min(size, len(data) - at))
    elif kind == 2:
        data[at : at + size] = random.bytes(min(size, len(data) - at))
    elif kind == 3:
        del data[at:]
    elif kind == 4:
        other = int(random.integers(0, len(data)))
        data[at : at + size] = data[other : other + size]
    else:
        words = list(WORD.finditer(content))
        if words:
            word = words[int(random.integers(0, len(words)))]
            new = STRANGE[int(random.integers(0, len(STRANGE)))]
            if kind == 6:
                new = words[int(random.integers(0, len(words)))].group()
            data[word.start() : word.end()] = new
    return bytes(data)
