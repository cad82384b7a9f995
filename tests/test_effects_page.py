"""The generated page of effects: measured figures, pictures that are SVG, and nothing forgotten."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from identification.errors import InputError
from testbench import effect_survey, effects_page
from testbench.effect_figures import confusion_svg, residual_svg
from testbench.effects import effects

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def two_effects(monkeypatch):
    few = {name: effects()[name] for name in ("actuator_lag", "base_tilt")}
    monkeypatch.setattr(effect_survey, "effects", lambda: few)


def test_the_page_measures_each_effect_and_draws_it(two_effects, models, tmp_path):
    effects_page.write_effects_page(models / "tx90.xml", tmp_path / "effects.md", 2)
    page = (tmp_path / "effects.md").read_text()
    shares = dict(re.findall(r"\| \[(\w+)\].*? \| (\d+) % \| [^|]* \|\n", page))
    assert sorted(shares) == ["actuator_lag", "base_tilt"]
    # Neither is like the other, and each signature knows its own law.
    assert min(int(share) for share in shares.values()) > 90
    for picture in re.findall(r"\]\((\S+\.svg)\)", page):
        assert ElementTree.parse(tmp_path / picture).getroot().tag == f"{SVG}svg"


def test_the_committed_page_has_every_effect(models):
    docs = models.parent / "docs"
    page = (docs / "effects.md").read_text()
    sections = re.findall(r"^## (\w+)$", page, flags=re.MULTILINE)
    assert sections == list(effects())
    for name, module in effects().items():
        assert (docs / "effects" / f"{name}.svg").is_file()
        for parameter in module.DESCRIPTION.parameters:
            assert f"| {parameter.name} | {parameter.unit} |" in page


def test_a_joint_without_a_next_one_is_refused(models, tmp_path):
    with pytest.raises(InputError, match="1 to 5"):
        effects_page.write_effects_page(models / "tx90.xml", tmp_path / "effects.md", 6)


def test_a_constant_residual_still_has_axes():
    x = np.linspace(0, 1, 50)
    picture = residual_svg((("time, s", x), ("a", x), ("b", x)), np.zeros(50), np.zeros(50), "N·m")
    assert len(ElementTree.fromstring(picture).findall(f"{SVG}path")) > 6


def test_confusion_has_a_square_a_pair():
    shares = {"one": {"one": 0.9, "two": 0.2}, "two": {"one": -0.1, "two": 1.0}}
    picture = ElementTree.fromstring(confusion_svg(shares, ("one", "two")))
    assert len(picture.findall(f"{SVG}rect")) == 1 + 4
    numbers = [text.text for text in picture.findall(f"{SVG}text")]
    assert {"90", "20", "100"} <= set(numbers)
