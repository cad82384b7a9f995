"""Names out of scenarios stay within the folder of results."""

from pathlib import Path

import pytest

from identification.errors import InputError
from testbench.scenario import load_scenario

from ..small_arm import SCENARIO

BAD = ("..", ".", "a/b", "/etc", "fit.h5", "FIT.h5", "report.html", "-x", "a b", "x" * 200, "")


@pytest.mark.parametrize("name", [*BAD, "..\\\\x"])
def test_a_variant_is_named_as_a_folder_may_be(tmp_path: Path, name: str) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO + f'variants:\n  "{name}": {{seed: 9}}\n')
    with pytest.raises(InputError, match="variants"):
        load_scenario(path)


@pytest.mark.parametrize("name", ["..", ".", "a/b", "/etc", "x" * 200])
def test_so_is_a_scenario(tmp_path: Path, name: str) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO.replace("name: small", f'name: "{name}"'))
    with pytest.raises(InputError, match="name: expected"):
        load_scenario(path)


def test_two_variants_do_not_share_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(SCENARIO + "variants:\n  loud: {seed: 9}\n  LOUD: {seed: 8}\n")
    with pytest.raises(InputError, match="variants: expected another name than"):
        load_scenario(path)
