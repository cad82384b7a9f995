"""What bad input must look like from outside."""

from pathlib import Path

import pytest

from testbench.cli import main


def complaint(arguments: str, capfd: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr of a command that exits with 2 and changes nothing where it stands."""
    assert not Path("pyproject.toml").exists(), "other tests write below the project"
    before = sorted(Path().rglob("*"))
    with pytest.raises(SystemExit) as exit_:
        main(arguments.split())
    out, err = capfd.readouterr()
    assert exit_.value.code == 2, err
    assert out == ""
    assert err.count("\n") == 1, err
    assert sorted(Path().rglob("*")) == before
    return err
