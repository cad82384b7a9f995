import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.chain import Chain
from identification.inverse_dynamics import inverse_dynamics
from identification.regressor import regressor
from identification.regressor_adjoint import regressor_adjoint

SAMPLES = 5
COULOMB_VELOCITY = 0.3
STEP = 1e-5


def random_chain(slides: str, seed: int) -> Chain:
    """A chain with random frames; one letter a joint, h for a hinge and s for a slide."""
    rng = np.random.default_rng(seed)
    return Chain(
        joint_names=tuple(f"joint_{j}" for j in range(len(slides))),
        parent=np.arange(len(slides)) - 1,
        is_slide=np.array([kind == "s" for kind in slides]),
        rotation=Rotation.random(len(slides), rng).as_matrix(),
        translation=rng.normal(size=(len(slides), 3)),
        gravity=np.array([0.4, -0.3, -9.8]),
        springs=np.zeros((len(slides), 4)),
    )


def random_motion(chain: Chain, seed: int) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).normal(size=(3, SAMPLES, chain.joints)))


def central_differences(chain, motion, seeds, columns, order):
    """d(sum of seeds * regressor) / d motion[order], (N, n)."""
    out = np.empty(motion[order].shape)
    for joint in range(chain.joints):
        ends = []
        for step in (STEP, -STEP):
            moved = [x.copy() for x in motion]
            moved[order][:, joint] += step
            matrix = regressor(chain, *moved, columns=columns, coulomb_velocity=COULOMB_VELOCITY)
            ends.append(np.sum(matrix * seeds, axis=(1, 2)))
        out[:, joint] = (ends[0] - ends[1]) / (2 * STEP)
    return out


@pytest.mark.parametrize("slides", ["h", "s", "hshhsh", "shhhhhhh"])
@pytest.mark.parametrize("every", [1, 3])
def test_equals_central_differences(slides, every):
    chain = random_chain(slides, seed=1)
    motion = random_motion(chain, seed=2)
    columns = np.arange(0, 14 * chain.joints, every)
    seeds = np.random.default_rng(3).normal(size=(SAMPLES, chain.joints, len(columns)))
    bars = regressor_adjoint(chain, *motion, seeds, columns, COULOMB_VELOCITY)
    differences = [central_differences(chain, motion, seeds, columns, order) for order in range(3)]
    for bar, difference in zip(bars, differences, strict=True):
        assert np.abs(bar - difference).max() <= 1e-7 * max(np.abs(d).max() for d in differences)


def test_joints_without_seeds_change_nothing():
    chain = random_chain("hshhsh", seed=4)
    motion = random_motion(chain, seed=5)
    seeds = np.random.default_rng(6).normal(size=(SAMPLES, 6, 84))
    parts = np.zeros((3, SAMPLES, 6))
    for joint in range(6):
        alone = np.zeros_like(seeds)
        alone[:, joint] = seeds[:, joint]
        parts += regressor_adjoint(chain, *motion, alone, None, COULOMB_VELOCITY)
    whole = np.array(regressor_adjoint(chain, *motion, seeds, None, COULOMB_VELOCITY))
    np.testing.assert_allclose(parts, whole, rtol=0, atol=1e-12 * np.abs(whole).max())
    nothing = regressor_adjoint(chain, *motion, np.zeros_like(seeds))
    assert not np.any(nothing)


def test_result_does_not_depend_on_the_number_of_threads():
    chain = random_chain("hhshh", seed=7)
    rng = np.random.default_rng(8)
    motion = rng.normal(size=(3, 1500, 5))
    seeds = rng.normal(size=(1500, 5, 70))
    one, two = (regressor_adjoint(chain, *motion, seeds, threads=threads) for threads in (1, 2))
    assert np.array_equal(one, two)


@pytest.mark.parametrize("slides", ["h", "s", "hshhsh"])
@pytest.mark.parametrize("coulomb_velocity", [0.0, 0.3])
def test_inverse_dynamics_equals_regressor_times_parameters(slides, coulomb_velocity):
    chain = random_chain(slides, seed=9)
    motion = random_motion(chain, seed=10)
    parameters = np.random.default_rng(11).normal(size=14 * chain.joints)
    tau = inverse_dynamics(chain, parameters, *motion, coulomb_velocity)
    expected = regressor(chain, *motion, coulomb_velocity=coulomb_velocity) @ parameters
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
