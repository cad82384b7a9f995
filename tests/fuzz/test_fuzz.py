"""A small part of ``make fuzz``, by a seed that stays."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from identification.errors import InputError
from testbench.containment import child
from testbench.files import read_json
from testbench.yaml_file import read_fields

from .fuzz import read_damaged
from .inputs import inputs

RUNS = 350
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda parts: st.lists(parts, max_size=4) | st.dictionaries(st.text(max_size=5), parts, max_size=4),
)


def test_what_is_damaged_is_good(tmp_path: Path) -> None:
    for each in inputs(tmp_path):
        (tmp_path / each.name).write_bytes(each.content)
        each.read(tmp_path / each.name)


def test_damaged_inputs_are_read_or_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child, "PATIENCE", 2.0)
    counts, broken = read_damaged(tmp_path, 56, RUNS)
    assert broken == []
    assert sum(counts.values()) == RUNS
    assert sum(count for name, count in counts.items() if name.endswith("refused")) > RUNS / 4


@settings(max_examples=60, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(text=st.text(alphabet="{}[]:,-&*!<>|'\"\n ab1.e#%@`?", max_size=60) | VALUES.map(repr))
def test_any_text_is_a_document_or_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "document"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    for read in (read_json, read_fields):
        try:
            read(path)
        except InputError as error:
            line = str(error)
        else:
            line = ""
        assert line.isprintable()
