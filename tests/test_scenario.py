import pytest

from identification.errors import InputError
from testbench.model_reading.reading import Choice
from testbench.scenario import load_scenario


@pytest.fixture
def scenario_file(tmp_path):
    def write(text):
        path = tmp_path / "scenario.yaml"
        path.write_text(text)
        return path

    return write


GOOD = "name: arm\nmodel: arm.xml\n"


def test_defaults_and_the_model_beside_the_file(scenario_file, tmp_path):
    scenario, variants = load_scenario(scenario_file(GOOD))
    assert scenario.model == tmp_path / "arm.xml"
    assert scenario.excitation.harmonics == 5
    assert variants == {}


def test_a_value_may_carry_its_unit(scenario_file):
    scenario, _ = load_scenario(scenario_file(GOOD + "excitation: {base_frequency: 0.2 Hz}\n"))
    assert scenario.excitation.base_frequency == 0.2


def test_what_of_the_model_is_the_robot_may_be_said(scenario_file, tmp_path):
    (tmp_path / "parts").mkdir()
    scenario, variants = load_scenario(
        scenario_file(
            GOOD + "joints: [lift, fold]\nfix_base: true\npackages: {arm_description: parts}\n"
            "variants: {one: {joints: [lift]}}\n"
        )
    )
    assert scenario.choice == Choice(("lift", "fold"), True, {"arm_description": tmp_path / "parts"})
    assert variants["one"].choice.joints == ("lift",)
    with pytest.raises(InputError, match=r"packages.arm_description: expected an existing folder"):
        load_scenario(scenario_file(GOOD + "packages: {arm_description: gone}\n"))


def test_variants_change_only_what_they_name(scenario_file):
    text = GOOD + "noise: {torque: 0.02, encoder_bits: 19}\nvariants: {loud: {noise: {torque: 0.1}}}\n"
    _, variants = load_scenario(scenario_file(text))
    assert variants["loud"].noise.torque == 0.1
    assert variants["loud"].noise.encoder_bits == 19
    assert variants["loud"].name == "arm-loud"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (GOOD + "speed: 3\n", r"speed: expected a known field.*valid: name, model"),
        (
            GOOD + "excitation: {criterium: logdet}\n",
            r"excitation.criterium: expected a known field.*criterion",
        ),
        (GOOD + "excitation: {criterion: best}\n", r"excitation.criterion: expected 'hadamard', 'condition'"),
        (
            GOOD + "excitation: {base_frequency: 6 rad/s}\n",
            r"base_frequency: expected a number in Hz, got '6 rad/s'",
        ),
        (GOOD + "simulation: {periods: two}\n", r"simulation.periods: expected a valid integer.*'two'"),
        (GOOD + "noise: {torque: .nan}\n", r"noise.torque: expected a finite number, got nan"),
        (GOOD + "noise: {torque: -1}\n", r"noise.torque: expected greater than or equal to 0, got -1"),
        ("model: arm.xml\n", r"name: expected a value, got nothing"),
        (GOOD + "variants: {x: {noise: {hum: 1}}}\n", r"variants.x.noise.hum: expected a known field"),
        ("- a\n- b\n", r"expected a mapping of fields, got list"),
        ("a: [\n", r"scenario: expected YAML"),
        (GOOD + "seed: 1\nseed: 2\n", r"seed: expected every key once, got it again in line 4"),
        (GOOD + "noise: {torque: 0.1, torque: 0.2}\n", r"torque: expected every key once, got .* line 3"),
        (GOOD + "excitation: {starts: true}\n", r"excitation.starts: expected a number or a text, got true"),
        (GOOD + "effects: [{effect: backlash, joint: yes}]\n", r"effects.0.joint: .* got true"),
        (
            GOOD + "effects: [{effect: stribeck_friction, joint: 1, values: {extra: .inf}}]\n",
            r"effects.0.values.extra: expected a finite number, got inf",
        ),
    ],
)
def test_faults_are_reported_in_one_line(scenario_file, text, complaint):
    path = scenario_file(text)
    with pytest.raises(InputError, match=complaint) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="existing YAML file"):
        load_scenario(tmp_path / "none.yaml")
