import numpy as np
import pytest
from streamline import GRAVITY, Motion, apply, particles, rotation

from utank_hil.dynamics import Tank
from utank_hil.dynamics.wrench import tank_wrench, water_moments

STEP = 0.01
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / STEP
SECOND = (
    np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
    / STEP**2
)
TIMES = STEP * np.arange(-4, 5)
TANKS, STATES = 20, 500  # 10,000 states


def random_tank(rng):
    return Tank(
        width_m=rng.uniform(3, 30),
        height_m=rng.uniform(1, 8),
        reservoir_area_m2=rng.uniform(1, 30),
        duct_area_m2=rng.uniform(0.1, 10),
        lx_m=rng.uniform(-40, 40),
        lz_m=rng.uniform(-8, 8),
        density_kg_m3=rng.uniform(800, 1100),
    )


@pytest.fixture(scope="module")
def cases():
    rng = np.random.default_rng(2006)
    tanks = [random_tank(rng) for _ in range(TANKS)]
    return [(tank, Motion(rng, STATES, tank.height_m)) for tank in tanks]


def relative(value, reference):
    """Largest error relative to the vector's norm, state by state."""
    value, reference = (np.reshape(x, (STATES, -1)) for x in (value, reference))
    error = np.linalg.norm(value - reference, axis=1) / np.linalg.norm(reference, axis=1)
    return error.max()


def earth_gravity_body(motion):
    turn = rotation(*motion.at(0.0)[1].T)
    return turn[:, 2, :] * GRAVITY


@pytest.mark.slow
def test_force_and_moment_are_weight_minus_rate_of_change_of_the_water_s_momentum(cases):
    for tank, motion in cases:
        momenta = [motion.momentum(tank, t) for t in TIMES]
        to_body = np.swapaxes(rotation(*motion.at(0.0)[1].T), 1, 2)
        p_dot, h_dot = (
            apply(to_body, np.tensordot(FIRST, np.array([m[k] for m in momenta]), 1))
            for k in (0, 1)
        )
        r, dm, *_ = particles(tank, motion.at(0.0)[2])
        g = earth_gravity_body(motion)
        weight = dm.sum(axis=1)[:, None] * g
        weight_moment = np.cross(np.einsum("nk,nki->ni", dm, r), g)
        force, moment, _ = tank_wrench(tank, *motion.body_state(0.0))
        assert relative(force, weight - p_dot) < 1e-8
        assert relative(moment, weight_moment - h_dot) < 1e-8


def test_residual_is_the_line_integral_of_the_differentiated_particle_paths(cases):
    for tank, motion in cases:
        acceleration = np.tensordot(SECOND, np.array([motion.paths(tank, t) for t in TIMES]), 1)
        to_body = np.swapaxes(rotation(*motion.at(0.0)[1].T), 1, 2)
        felt = apply(to_body, acceleration) - earth_gravity_body(motion)[:, None, :]
        _, _, dl, tangents, _ = particles(tank, motion.at(0.0)[2])
        expected = np.einsum("nk,nki,ki->n", dl, felt, tangents)
        _, _, residual = tank_wrench(tank, *motion.body_state(0.0))
        scale = np.einsum("nk,nki->n", dl, np.abs(felt))
        assert np.max(np.abs(residual - expected) / scale) < 1e-8


def particle_sums(tank, state):
    """Force, moment and residual by quadrature of (2.6), with the flux at the two corners."""
    h, h_dot, h_ddot, v0, omega, v0_dot, omega_dot, phi, theta = state
    r, dm, dl, tangents, speeds = particles(tank, h)
    v0, omega, v0_dot, omega_dot = (x[:, None, :] for x in (v0, omega, v0_dot, omega_dot))
    flow = (h_dot[:, None] * speeds)[..., None] * tangents
    acceleration = (
        v0_dot
        + np.cross(omega, v0)
        + np.cross(omega_dot, r)
        + 2 * np.cross(omega, flow)
        + np.cross(omega, np.cross(omega, r))
        + (h_ddot[:, None] * speeds)[..., None] * tangents
    )
    g = GRAVITY * np.stack(
        [-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)], axis=-1
    )
    felt = acceleration - g[:, None, :]
    force = -np.einsum("nk,nki->ni", dm, felt)
    moment = -np.einsum("nk,nki->ni", dm, np.cross(r, felt))
    ratio = tank.reservoir_area_m2 / tank.duct_area_m2
    down, across = np.array([0, 0, 1.0]), np.array([0, ratio, 0])
    for y, before, after in ((-1, down, across), (1, across, -down)):
        corner = np.array([tank.lx_m, y * tank.width_m / 2, tank.lz_m])
        flux = tank.density_kg_m3 * tank.reservoir_area_m2 * (h_dot**2)[:, None] * (after - before)
        force -= flux
        moment -= np.cross(corner, flux)
    residual = np.einsum("nk,nki,ki->n", dl, felt, tangents)
    scales = (
        np.einsum("nk,nki->n", dm, np.abs(felt)),
        np.einsum("nk,nki->n", dm, np.abs(r).sum(-1, keepdims=True) * np.abs(felt)),
        np.einsum("nk,nki->n", dl, np.abs(felt)),
    )
    return (force, moment, residual), scales


def test_quadrature_of_particle_acceleration_plus_corner_flux(cases):
    for tank, motion in cases:
        state = motion.body_state(0.0)
        expected, scales = particle_sums(tank, state)
        for value, reference, scale in zip(
            tank_wrench(tank, *state), expected, scales, strict=True
        ):
            error = np.abs(value - reference).reshape(STATES, -1).max(axis=1)
            assert np.max(error / scale) < 1e-12


def test_corner_flux_pulls_down_at_the_tank_s_station_only():
    tank = Tank(17.1, 4.88, 17.11, 6.22, lx_m=7.0, lz_m=1.83)
    zero = np.zeros(3)
    still, moving = (
        tank_wrench(tank, 0.0, speed, 0.0, zero, zero, zero, zero, 0.0, 0.0) for speed in (0, 1.5)
    )
    lift = 2 * 1000 * 17.11 * 1.5**2
    np.testing.assert_allclose(moving[0] - still[0], [0, 0, lift], rtol=1e-9)
    np.testing.assert_allclose(moving[1] - still[1], [0, -7.0 * lift, 0], rtol=1e-9, atol=1e-6)
    assert moving[2] == still[2]


def test_water_inertia_is_symmetric_and_positive(cases):
    for tank, motion in cases:
        inertia = water_moments(tank, motion.at(0.0)[2]).inertia_kgm2
        np.testing.assert_array_equal(inertia, np.swapaxes(inertia, -1, -2))
        assert np.linalg.eigvalsh(inertia).min() > 0


def test_leading_shapes_broadcast():
    tank = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83)
    rng = np.random.default_rng(1)
    h, rate = rng.normal(size=(4, 1)), rng.normal(size=(1, 5, 3))
    force, moment, residual = tank_wrench(
        tank, h, 0.1, 0.2, np.zeros(3), rate, np.ones(3), np.zeros(3), 0.3, 0.1
    )
    assert force.shape == moment.shape == (4, 5, 3)
    assert residual.shape == (4, 5)
    one = tank_wrench(
        tank, h[2, 0], 0.1, 0.2, np.zeros(3), rate[0, 3], np.ones(3), np.zeros(3), 0.3, 0.1
    )
    np.testing.assert_allclose(force[2, 3], one[0], rtol=1e-14)
    np.testing.assert_allclose(residual[2, 3], one[2], rtol=1e-14)


def test_wrong_vector_shape_is_named():
    tank = Tank(17.1, 4.88, 17.11, 6.22)
    with pytest.raises(ValueError, match=r"rate_dot must have shape \(\.\.\., 3\), got \(2,\)"):
        tank_wrench(tank, 0, 0, 0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2), 0, 0)
