from dataclasses import replace

import numpy as np
import pytest
from roll_energy import LEVERS, ship_potential
from streamline import GRAVITY, Motion, particles, rotation

from tools.thesis.reference import simulate_reference
from tools.thesis.six_degree import (
    SixDegreeModel,
    SixDegreeShip,
    body_to_earth,
    euler_rates,
    simulate_six_degree,
)
from utank_hil.dynamics import RollModel, Tank

pytestmark = pytest.mark.slow

TANK = Tank(17.1, 4.88, 17.11, 6.22, lx_m=-12.0, lz_m=1.83)
ROLL = replace(LEVERS, offset_moment_nm=1e6, wind_moment_nm=5e5)
ADDED = np.diag([2e5, 4e6, 6e6, 3e8, 5e9, 4e9])
ADDED[1, 3] = ADDED[3, 1] = -3e6
ADDED[1, 5] = ADDED[5, 1] = 2e7
ADDED[2, 4] = ADDED[4, 2] = -4e7
SHIP = SixDegreeShip(
    roll=ROLL,
    mass_kg=5e6,
    pitch_inertia_kg_m2=6e9,
    yaw_inertia_kg_m2=6.5e9,
    product_xz_kg_m2=-1e8,
    added_mass=tuple(map(tuple, ADDED.tolist())),
    heave_stiffness_n_m=1.3e7,
    heave_pitch_n=4e7,
    pitch_stiffness_nm_rad=8e9,
)
START = np.array([0, 0, 0.3, 0.25, 0.05, 0.2, 3.0, 0.2, -0.2, 0.0, 0.03, -0.02, 1.0, 0.0])


def energy(ship, tank, state):
    """Total energy of states (n, 14), the water's from its particles."""
    z, (roll, pitch, yaw), nu = state[:, 2], state[:, 3:6].T, state[:, 6:12]
    r, dm, _, tangents, speeds = particles(tank, state[:, 12])
    flow = (state[:, 13][:, None] * speeds)[..., None] * tangents
    velocity = nu[:, None, :3] + np.cross(nu[:, None, 3:], r) + flow
    down = rotation(roll, pitch, yaw)[:, 2, :]
    depth = z[:, None] + np.einsum("nki,ni->nk", r, down)
    carrying_depth = z + tank.lx_m * down[:, 0]
    water = dm.sum(axis=1)
    hull = (
        0.5 * ship.heave_stiffness_n_m * z**2
        + ship.heave_pitch_n * z * pitch
        + 0.5 * ship.pitch_stiffness_nm_rad * pitch**2
        - ship.roll.offset_moment_nm * np.sin(roll)
        - ship.roll.wind_moment_nm * roll
        + ship_potential(ship.roll, roll)
    )
    return (
        0.5 * np.einsum("ni,ij,nj->n", nu, ship.mass_matrix(), nu)
        + 0.5 * np.einsum("nk,nki,nki->n", dm, velocity, velocity)
        - GRAVITY * np.einsum("nk,nk->n", dm, depth)
        + GRAVITY * water * carrying_depth
        + hull
    )


@pytest.mark.evidence
def test_energy_is_constant_in_six_degrees():
    _, state = simulate_six_degree(SixDegreeModel(SHIP, TANK), 25.0, START, tolerance=1e-11)
    values = energy(SHIP, TANK, state)
    rest = energy(SHIP, TANK, np.zeros((1, 14)))[0]
    assert np.abs(state[:, 3]).max() > 0.2
    assert np.abs(state[:, 12]).max() < TANK.level_limit_m
    assert np.ptp(values) < 1e-9 * (values[0] - rest)


def test_horizontal_momentum_of_ship_and_water_is_constant():
    """Without added mass nothing pushes sideways but the water, whatever it does."""
    ship = replace(SHIP, added_mass=((0.0,) * 6,) * 6)
    _, state = simulate_six_degree(SixDegreeModel(ship, TANK), 20.0, START, samples=101)
    r, dm, _, tangents, speeds = particles(TANK, state[:, 12])
    nu = state[:, 6:12]
    flow = (state[:, 13][:, None] * speeds)[..., None] * tangents
    velocity = nu[:, None, :3] + np.cross(nu[:, None, 3:], r) + flow
    body = 5e6 * nu[:, :3] + np.einsum("nk,nki->ni", dm, velocity)
    earth = np.einsum("nij,nj->ni", rotation(*state[:, 3:6].T), body)
    assert np.ptp(earth[:, :2], axis=0).max() < 1e-7 * np.abs(earth).max()
    assert np.ptp(earth[:, 2]) > 1e-2 * np.abs(earth).max()


def test_upright_is_an_equilibrium_with_the_tank_off_the_centre_of_gravity():
    ship = replace(SHIP, roll=LEVERS)
    assert np.abs(SixDegreeModel(ship, TANK).derivative(np.zeros(14))).max() < 1e-15


@pytest.mark.evidence
@pytest.mark.parametrize("lx", [0.0, -12.0])
def test_with_the_other_motions_held_it_is_the_roll_model(lx):
    tank = replace(TANK, lx_m=lx, damping_ratio=0.1, quadratic_loss=1.0)
    roll = replace(ROLL, damping_nms_rad=5e7, quadratic_damping_nms2_rad2=2e8)

    def pressure(t):
        return 5e3 * np.sin(0.4 * t)

    def force(t):
        return np.array([0, 0, 0, 5e6 * np.cos(0.4 * t), 0, 0])

    start = np.zeros(14)
    start[[3, 9, 12, 13]] = state0 = np.array([0.25, 0.0, 1.0, 0.0])
    _, state = simulate_six_degree(
        SixDegreeModel(replace(SHIP, roll=roll), tank, free=("roll",)),
        30.0,
        start,
        pressure_pa=pressure,
        force=force,
        samples=61,
        tolerance=1e-12,
    )
    run = simulate_reference(
        RollModel(roll, tank),
        30.0,
        state0,
        pressure_pa=pressure,
        wave_moment_nm=lambda t: 5e6 * np.cos(0.4 * t),
        samples=61,
    )
    assert run.impacts == ()
    np.testing.assert_allclose(state[:, [3, 9, 12, 13]], run.state, atol=1e-9)
    held = np.delete(np.arange(12), [3, 9])
    assert not state[:, held].any()


def test_transformation_equals_three_plane_rotations_and_their_rates():
    motion = Motion(np.random.default_rng(2), 50, 1.0)
    angles, angle_rates = motion.at(0.0)[1], motion.at(0.0, 1)[1]
    body_rates = motion.rates(0.0)[0]
    for one, dot, rate in zip(angles, angle_rates, body_rates, strict=True):
        np.testing.assert_allclose(body_to_earth(*one), rotation(*one), atol=1e-15)
        np.testing.assert_allclose(euler_rates(*one[:2]) @ rate, dot, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"added_mass": ((0.0,) * 5,) * 6}, "added_mass must hold 6 x 6"),
        ({"added_mass": ((0, 1, 0, 0, 0, 0),) + ((0,) * 6,) * 5}, "symmetric"),
        ({"damping": tuple(map(tuple, np.eye(6)))}, r"damping\[3\]\[3\]"),
        ({"mass_kg": -1e9}, "positive definite"),
    ],
)
def test_bad_ships_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(SHIP, **change)


def test_unknown_motions_and_singular_attitude_are_refused():
    with pytest.raises(ValueError, match="unknown motions"):
        SixDegreeModel(SHIP, TANK, free=("rolling",))
    with pytest.raises(ValueError, match="singular"):
        euler_rates(0.0, np.pi / 2)
