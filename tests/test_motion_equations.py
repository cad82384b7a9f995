"""The mass matrix and bias of one pass, against inverse dynamics."""

import numpy as np
import pytest

from identification.inverse_dynamics import inverse_dynamics, mass_matrices
from identification.motion_equations import SCRATCH, mass_and_bias
from identification.parameters import COULOMB, PER_JOINT, VISCOUS

from .test_regressor_adjoint import random_chain

CHAINS = {
    "h": [-1],
    "s": [-1],
    "hshhsh": [-1, 0, 1, 2, 3, 4],
    "hhhsh": [-1, 0, 0, 2, 1],
    "hhhh": [-1, 0, -1, 2],
}


@pytest.mark.parametrize("slides", CHAINS)
def test_equals_inverse_dynamics(slides):
    chain, n = random_chain(slides, seed=1), len(slides)
    chain.parent[:] = CHAINS[slides]
    rng = np.random.default_rng(2)
    chain.springs[:, 0], chain.springs[:, 3] = rng.normal(size=(2, n))
    table = rng.normal(size=(n, PER_JOINT))
    table[:, [VISCOUS, COULOMB]] = 0.0
    q, dq = rng.normal(size=(2, n))
    mass, bias = np.empty((n, n)), np.empty(n)
    mass_and_bias(*chain.arrays, table, q, dq, np.empty((n, SCRATCH)), mass, bias)
    expected = inverse_dynamics(chain, table.ravel(), q[None], dq[None], np.zeros((1, n)))[0]
    np.testing.assert_allclose(bias, expected, atol=1e-11)
    np.testing.assert_allclose(mass, mass_matrices(chain, table.ravel(), q[None])[0], atol=1e-11)
