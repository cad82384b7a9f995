import mujoco
import numpy as np
import pytest

from testbench.simulation.bare_model import bare_model
from testbench.simulation.plant import plant_model

SPRUNG = """
<mujoco>
  <option density="1.2" viscosity="0.1" wind="1 0 0" gravity="0 1 -9"/>
  <worldbody>
    <geom type="plane" size="1 1 .1"/>
    <body pos="0 0 .5" quat=".8 .6 0 0" gravcomp="0.5">
      <joint axis="0 1 1" pos=".1 0 0" stiffness="30" springref="20" ref="10" damping="2" armature=".3"/>
      <geom type="capsule" size=".05" fromto="0 0 0 .3 .1 0"/>
      <body pos=".3 0 0">
        <joint type="slide" axis="1 0 0" stiffness="100" frictionloss="3"/>
        <geom type="box" size=".1 .05 .02" pos=".1 0 0"/>
        <body pos="0 0 .2"><geom type="sphere" size=".04"/></body>
      </body>
    </body>
  </worldbody>
  {extra}
</mujoco>
"""
TENDON = '<tendon><fixed stiffness="50"><joint joint="a" coef="1"/></fixed></tendon>'


def sprung(extra=""):
    xml = SPRUNG.replace("{extra}", extra).replace('<joint axis="0 1 1"', '<joint name="a" axis="0 1 1"')
    return mujoco.MjModel.from_xml_string(xml)


def motions(model, steps=20):
    """Positions, velocities and accelerations after some steps from random states under random torques."""
    plant = plant_model(model, 1e-3)
    data = mujoco.MjData(plant)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(50):
        data.qpos[:], data.qvel[:] = rng.uniform(-1, 1, (2, model.nv))
        data.qfrc_applied[:] = rng.uniform(-10, 10, model.nv)
        mujoco.mj_step(plant, data, steps)
        found.append(np.concatenate([data.qpos, data.qvel, data.qacc]))
    return np.array(found)


@pytest.mark.parametrize("name", ["tx90", "rail_arm"])
def test_an_arm_without_its_geoms_moves_the_same_bit_for_bit(models, name):
    model = mujoco.MjModel.from_xml_path(str(models / f"{name}.xml"))
    bare = bare_model(model)
    assert bare.ngeom == bare.nu == 0 < model.ngeom
    assert np.array_equal(motions(bare), motions(model))


def test_springs_gravity_compensation_fluid_and_options_stay():
    model = sprung()
    assert np.array_equal(motions(bare_model(model)), motions(model))


def test_a_model_changed_after_it_was_compiled_keeps_the_changes(models):
    model = mujoco.MjModel.from_xml_path(str(models / "tx90.xml"))
    before = motions(bare_model(model))
    model.body_mass[-1] += 5.0
    model.opt.gravity[:] = 1.0, 0.0, -9.7
    after = motions(bare_model(model))
    assert np.array_equal(after, motions(model))
    assert not np.allclose(after, before)


def test_a_model_with_more_than_bodies_and_joints_is_left_whole():
    model = sprung(TENDON)
    assert bare_model(model) is model
