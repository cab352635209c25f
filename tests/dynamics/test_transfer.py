"""Transfer matrices at many points: right for any order, and in little memory."""

import tracemalloc

import numpy as np
import pytest

from utank_hil.dynamics.sampling import LinearModel, state_space_response

RANDOM = np.random.default_rng(5)


def chain(states):
    """A delay of so many samples: z^-states, and besides it a feed-through of two."""
    b, c = np.zeros((states, 1)), np.zeros((2, states))
    b[0, 0] = c[0, -1] = 1.0
    return LinearModel(np.eye(states, k=-1), b, c, np.array([[0.0], [2.0]]), 0.1)


def test_a_delay_is_a_power_of_z():
    z = np.exp(1j * RANDOM.uniform(0, np.pi, 50))
    found = state_space_response(chain(7), z)
    assert found.shape == (50, 2, 1)
    np.testing.assert_allclose(found[:, 0, 0], z**-7, rtol=1e-12)
    np.testing.assert_allclose(found[:, 1, 0], 2.0)


@pytest.mark.slow
def test_memory_does_not_grow_with_points_times_the_square_of_the_order():
    z = np.exp(1j * RANDOM.uniform(0, np.pi, 1000))
    model = chain(120)
    tracemalloc.start()
    found = state_space_response(model, z)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_allclose(found[:, 0, 0], z**-120, rtol=1e-9)
    assert peak < 1000 * 120**2 * 16 / 3  # all resolvents at once are 230 MB, and as much again
