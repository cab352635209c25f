"""A ship in three and six degrees with its tank, against `tank_wrench` and the frequency domain."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from others import others_file

from firmware_sim.plant import Plant
from firmware_sim.voyage import turning
from firmware_sim.waves import SteadyWaves
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.hull import lateral_kernel as kernel
from utank_hil.dynamics.hull import radiation
from utank_hil.dynamics.hull.hull_data import radiation_at
from utank_hil.dynamics.hull.lateral import LateralHull, LateralModel
from utank_hil.dynamics.hull.radiation import fit_radiation
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.dynamics.wrench import tank_wrench, water_moments
from utank_hil.sea import Harmonics

TANK = Tank(8.0, 2.5, 2.0, 0.7, lx_m=3.0, lz_m=-0.5, damping_ratio=0.1, density_kg_m3=1025.0)


def linear_response(model, omega, force):
    """Motions in the frequency domain of the data, shape (4,) or (7,).

    They are sway, roll, yaw and level, then surge, heave and pitch if the force has their rows.
    """
    lateral, sign = np.ix_([1, 3, 5], [1, 3, 5]), np.outer([-1, 1, -1], [-1, 1, -1])
    radiated = radiation_at(model.hull.about_g, omega)
    added, damping = ((m[lateral] + m[lateral].T) / 2 * sign for m in radiated)
    matrix = np.zeros((4, 4), dtype=complex)
    matrix[:3, :3] = -(omega**2) * (added + model.hull.rigid_mass) + 1j * omega * damping
    water, tank = water_moments(model.tank, 0.0), model.tank
    area, density = tank.reservoir_area_m2, tank.density_kg_m3
    mass = np.zeros((4, 4))
    mass[0] = [water.mass_kg, -water.first_kgm[2], water.first_kgm[0], water.first_slope_kg[1]]
    mass[1:3, 1:3] = water.inertia_kgm2[np.ix_([0, 2], [0, 2])]
    mass[1:3, 3] = water.swirl_kgm[[0, 2]]
    mass[3, 3] = density * area * tank.effective_length_m
    matrix -= omega**2 * (np.triu(mass) + np.triu(mass, 1).T)
    matrix[1, 1] += model.ship.stiffness_nm_rad + GRAVITY_M_S2 * water.first_kgm[2]
    matrix[1, 1] += 1j * omega * model.viscous_nms_rad
    matrix[1, 3] -= GRAVITY_M_S2 * water.first_slope_kg[1]
    matrix[3, 1] = matrix[1, 3]
    matrix[3, 3] += 2 * density * GRAVITY_M_S2 * area + 1j * omega * area * tank.loss_pa_per_m_s
    lateral_motions = np.linalg.solve(matrix, np.append(force[:3], 0.0))
    if len(force) == 3:
        return lateral_motions
    vertical, sign = np.ix_([0, 2, 4], [0, 2, 4]), np.outer([1, -1, -1], [1, -1, -1])
    data = model.hull.about_g
    added, damping = (m[vertical] * sign for m in radiated)
    matrix = -(omega**2) * (added + data.mass_matrix[vertical] * sign) + 1j * omega * damping
    # The water as a body at rest in the ship, by its tensor: surge, heave, pitch.
    mass = np.diag([water.mass_kg, water.mass_kg, water.inertia_kgm2[1, 1]])
    mass[0, 2] = mass[2, 0] = water.first_kgm[2]
    mass[1, 2] = mass[2, 1] = -water.first_kgm[0]
    matrix += data.hydrostatic[vertical] * sign - omega**2 * mass
    matrix[2, 2] += GRAVITY_M_S2 * water.first_kgm[2]
    return np.concatenate([lateral_motions, np.linalg.solve(matrix, force[3:])])


@cache
def hull():
    """A Wigley hull of 60 x 12 x 4 m, whole, by Capytaine."""
    file = Path(__file__).parent / "data" / "wigley.nc"
    return LateralHull(read_hull(file, Given(gyration_m=(4.56, 15.0, 15.0))))


@cache
def ship():
    stiffness = hull().stiffness_nm_rad
    inertia = 1.15 * float(hull().rigid_mass[1, 1])
    viscous = 2 * 0.03 * math.sqrt(stiffness * inertia)
    return RollShip(inertia, stiffness, hull().radiated_nms_rad() + viscous)


@pytest.mark.parametrize("six", [False, True])
def test_ship_and_water_move_by_the_exact_wrench(six):
    rough = replace(
        ship(), quadratic_damping_nms2_rad2=2e6, offset_moment_nm=1e5, wind_moment_nm=2e5,
        restoring_odd_nm=(-1e7,),
    )  # fmt: skip
    tank = replace(TANK, lz_m=1.2, quadratic_loss=1.0)
    model, roll_model = LateralModel(hull(), rough, tank, six), RollModel(rough, tank)
    inertia = hull().rigid_mass + hull().radiation.infinite_added_mass
    parameters = model.packed(rough)
    if six:  # surge and pitch are held
        parameters[[27, 32]], parameters[[28, 29, 31]] = 1e30, 0.0
    rng = np.random.default_rng(1)
    for _ in range(100):
        roll, rate, level, speed, sway = rng.uniform(-1, 1, 5) * [0.8, 0.4, 2.0, 1.0, 2.0]
        (change, turn), pressure = rng.uniform(-0.5, 0.5, 2), 1e4 * rng.uniform(-1, 1)
        force = np.append(rng.uniform(-1, 1, 6) * ([1e5, 1e6, 1e6] * 2), [change, turn])
        fall = float(rng.uniform(-2, 2)) if six else 0.0
        x = [roll, rate, level, speed, 0.0, sway, 0.0, 0.0]
        x += [0.0, 0.0, 0.0, 0.0, fall, 0.0] if six else []
        out = np.zeros(14)
        step = kernel.Step(
            parameters, np.zeros((0, 7)), np.zeros((0, 7)), *roll_model.packed[1:], 0.0,
            np.empty((7, 7)), np.empty(7), np.empty((3, 8)), np.empty((3, len(x))),
        )  # fmt: skip
        kernel.rates(step, np.array(x), force, tank.reservoir_area_m2 * pressure, out)
        sin, cos = math.sin(roll), math.cos(roll)
        down, aside = out[12], out[5] + turn
        water_force, moment, residual = tank_wrench(
            tank, level, speed, out[kernel.LEVEL_RATE],
            [0, sway * cos + fall * sin, fall * cos - sway * sin], [rate, 0, 0],
            [0, (aside + fall * rate) * cos + (down - sway * rate) * sin,
             (down - sway * rate) * cos - (aside + fall * rate) * sin],
            [out[1], out[7] * sin, out[7] * cos], roll, 0.0,
        )  # fmt: skip
        loads = np.array([water_force @ [0, cos, -sin], moment[0], moment @ [0, sin, cos]])
        loads += force[:3]
        # the forces on hull and rudder turn the water, too
        loads += tank.water_kg * turn * np.array([1.0, 0.0, tank.lx_m])
        viscous = model.viscous_nms_rad + rough.quadratic_damping_nms2_rad2 * abs(rate)
        loads[1] += rough.wind_moment_nm + rough.offset_moment_nm * cos - viscous * rate
        loads[1] -= (1 + change) * float(roll_model.restoring.moment_nm(roll))
        np.testing.assert_allclose(inertia @ out[[5, 1, 7]], loads, atol=1e-9 * abs(loads).max())
        loss = (tank.loss_pa_per_m_s + tank.quadratic_loss_pa_per_m2_s2 * abs(speed)) * speed
        assert tank.density_kg_m3 * residual == pytest.approx(pressure - loss, abs=1e-6)
        if six:
            buoyed = force[4] + water_force @ [0, sin, cos] - GRAVITY_M_S2 * tank.water_kg
            own = parameters[30] - tank.water_kg
            assert own * down == pytest.approx(buoyed, abs=1e-9 * abs(own * down))


def test_memory_of_surge_heave_and_pitch_is_the_radiation_of_the_data_to_one_percent():
    assert hull().vertical_radiation.error < 0.01


def test_a_start_from_which_the_fit_goes_astray_is_followed_by_another(monkeypatch):
    starts = radiation._STARTS
    monkeypatch.setattr(radiation, "_STARTS", ((10.0, 0.0),))
    assert LateralHull(hull().data).radiation.error > 0.1
    monkeypatch.setattr(radiation, "_STARTS", ((10.0, 0.0), *starts))
    assert LateralHull(hull().data).radiation.error < 0.005


@pytest.mark.parametrize(
    ("file", "given"),
    [
        ("wamit-fpso/fpso.1", Given(density_kg_m3=1025.0, mass_kg=1.004e8,
                                    gyration_m=(16.3, 54.0, 54.0), gravity_centre_m=(0, 0, -1.0))),
        ("shipx-supply/input.re7", Given()),
        ("aqwa-cylinder/cylinder.AH1", Given(gyration_m=(0.2, 0.2, 0.2))),
    ],
    ids=["fpso", "supply", "cylinder"],
)  # fmt: skip
def test_memory_is_the_radiation_of_other_peoples_hulls_to_one_percent(file, given):
    found = LateralHull(read_hull(others_file(f"hulls/{file}"), given))
    assert found.radiation.error < 0.01


@pytest.mark.parametrize("limit", [True, False])
def test_memory_is_the_radiation_of_the_data_to_one_percent(limit):
    data, found = hull().about_g, hull().radiation
    if not limit:  # the fit finds it
        lateral = np.ix_([1, 3, 5], [1, 3, 5])
        sign = np.outer([-1, 1, -1], [-1, 1, -1])
        added, damping = (
            np.array([(m[lateral] + m[lateral].T) / 2 * sign for m in each])
            for each in (data.added_mass, data.damping)
        )
        again = fit_radiation(data.frequency_rad_s, added, damping)
        np.testing.assert_allclose(
            np.diag(again.infinite_added_mass), np.diag(found.infinite_added_mass), rtol=0.05
        )
        found = again
    assert found.error < 0.01
    # energy is never given back, at any frequency and in any motion
    s = 1j * np.geomspace(1e-2, 1e2, 200)[:, None, None]
    matrix = s**2 * np.eye(len(found.loss)) + s * (found.loss @ found.loss.T)
    matrix = matrix + np.diag(found.frequency_rad_s**2)
    memory = s * (found.direction.T @ np.linalg.solve(matrix, found.direction))
    least = np.linalg.eigvalsh(memory.real)[:, 0]
    assert np.all(least > -1e-9 * np.abs(memory.real).max())


@pytest.mark.parametrize(
    ("heading_deg", "omega", "six"),
    [(60.0, 0.8, False), (135.0, 0.5, True), (135.0, 1.1, True), (20.0, 0.8, True)],
)
def test_plant_in_a_regular_wave_is_the_frequency_domain_of_the_data_to_one_percent(
    heading_deg, omega, six
):
    """Added mass and damping of the file, not of the fit; interpolated between its frequencies."""
    model = LateralModel(hull(), ship(), TANK, six)
    heading = np.array([math.radians(heading_deg)])
    force = 0.01 * hull().forces(np.array([omega]), heading, six=six)[:, 0]
    waves = [Harmonics(np.array([abs(f)]), np.array([omega]), np.array([np.angle(f)]))
             for f in force]  # fmt: skip
    plant = Plant(ship(), TANK, None, SteadyWaves(*waves), hull=hull(), six=six)
    begin_s, rows, times = 120.0, [], []
    speeds = [kernel.SWAY_RATE, kernel.ROLL_RATE, kernel.YAW_RATE, kernel.LEVEL_RATE]
    speeds += [8 + 2 * len(model.oscillators) + each for each in (3, 4, 5)] if six else []
    for tick in range(round(100 * (begin_s + 4 * math.pi / omega))):
        plant.advance(tick * TICK_NS)
        if tick > 100 * begin_s:
            times.append(0.01 * tick)
            rows.append((*plant._x[speeds], plant.lateral_m_s2, plant.heave_m_s2))
    at = np.array(times)
    basis = np.column_stack([np.cos(omega * at), -np.sin(omega * at), np.ones_like(at)])
    real, imaginary, _ = np.linalg.lstsq(basis, np.array(rows), rcond=None)[0]
    motions = linear_response(model, omega, force)
    expected = [*1j * omega * motions, -(omega**2) * motions[0]]
    found = (real + 1j * imaginary)[: len(expected)]
    assert np.all(np.abs(found / expected - 1) < 0.01)
    if six:
        tank = -(omega**2) * (motions[5] - TANK.lx_m * motions[6])
        assert abs((real + 1j * imaginary)[-1] / tank - 1) < 0.01


def test_long_wave_carries_the_ship_and_its_water_along():
    model, omega = LateralModel(hull(), ship(), TANK), 0.2
    force = hull().forces(np.array([omega]), np.array([math.pi / 2]))[:, 0]
    sway, roll, _, level = linear_response(model, omega, force)
    slope = 1j * omega**2 / 9.80665
    assert -(omega**2) * sway / (9.80665 * slope) == pytest.approx(1.0, abs=0.03)
    assert roll / slope == pytest.approx(1.0, abs=0.1)
    assert abs(level) < 0.1 * abs(roll) * TANK.width_m / 2


@pytest.mark.parametrize(("six", "change"), [(False, 0.0), (True, 0.0), (False, 0.2), (True, 0.2)])
def test_energy_adds_up_with_strikes(six, change):
    tank = replace(TANK, quadratic_loss=2.0, headroom_m=0.6, restitution=0.2)
    heavy = replace(ship(), quadratic_damping_nms2_rad2=3e6, wind_moment_nm=3e5)
    model = LateralModel(hull(), heavy, tank, six)
    force = hull().forces(np.array([0.8]), np.array([2.0]), six=six)[:, 0]
    waves = [Harmonics(np.array([abs(f)]), np.array([0.8]), np.array([np.angle(f)]))
             for f in force]  # fmt: skip
    turn = None
    if change:
        waves.append(Harmonics(np.array([change]), np.array([0.8]), np.array([1.0])))
        turn = turning(lambda t: 0.02 * max(t - 20, 0), lambda _: 7.0, 1e6, 2.0)
    plant = Plant(heavy, tank, None, SteadyWaves(*waves), hull=hull(), six=six, turning=turn)
    for tick in range(6001):
        plant.advance(tick * TICK_NS)
    assert plant.strikes > 3
    x, parameters, oscillators = plant._x, model.packed(heavy), model.oscillators
    mass = np.zeros((7, 7))
    kernel.mass_matrix(parameters, x[kernel.ROLL], x[kernel.LEVEL], six, mass)
    mass = np.triu(mass) + np.triu(mass, 1).T
    end = kernel.WAVES + 2 * len(oscillators)
    vertical = x[end : end + 6] if six else np.zeros(6)
    speeds = x[[kernel.SWAY_RATE, kernel.ROLL_RATE, kernel.YAW_RATE, kernel.LEVEL_RATE]]
    speeds = np.concatenate([vertical[3:], speeds])
    roll, level, c = x[kernel.ROLL], x[kernel.LEVEL], RollModel(heavy, tank).coefficients
    stored_j = 0.5 * speeds @ mass @ speeds + 0.5 * heavy.stiffness_nm_rad * roll**2
    for memory, state in ((oscillators, x[kernel.WAVES : end]), (model.vertical, x[end + 6 :])):
        place, rate = state.reshape(2, -1)
        stored_j += 0.5 * (rate @ rate + memory[:, 3] @ place**2)
    if six:
        stiff, sign = hull().about_g.hydrostatic[np.ix_([0, 2, 4], [0, 2, 4])], [1, -1, -1]
        stiff = stiff * np.outer(sign, sign)
        stiff[2, 2] += c.weight_lever
        stored_j += 0.5 * vertical[:3] @ stiff @ vertical[:3]
        assert abs(speeds[1]) > 0.1
    stored_j -= heavy.wind_moment_nm * roll + c.weight_h * level * math.sin(roll)
    stored_j -= (c.weight_lever - c.weight_h2 * level**2) * math.cos(roll) - c.weight_lever
    work_j = plant.wave_work_j - plant.losses_j
    assert work_j == pytest.approx(stored_j, abs=1e-5 * plant.losses_j)


def test_ship_that_is_not_the_hull_s_is_refused():
    with pytest.raises(ValueError, match=r"stiffness_nm_rad is .* make them agree"):
        LateralModel(hull(), replace(ship(), stiffness_nm_rad=1e7), TANK)
    with pytest.raises(ValueError, match=r"damping_nms_rad is .* less than what waves .* raise it"):
        LateralModel(hull(), replace(ship(), damping_nms_rad=1.0), TANK)


def test_hull_whose_sides_differ_is_refused_in_six_degrees():
    data = hull().data
    added = np.array(data.added_mass)
    added[:, 2, 3] = added[:, 3, 2] = 0.2 * np.sqrt(added[:, 2, 2] * added[:, 3, 3])
    odd = LateralHull(replace(data, added_mass=added))
    LateralModel(odd, ship(), TANK)
    with pytest.raises(ValueError, match=r"couple heave.* by \d+ %: take sway_roll_yaw"):
        LateralModel(odd, ship(), TANK, six=True)
