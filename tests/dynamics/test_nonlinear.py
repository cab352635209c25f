from dataclasses import replace

import numpy as np
import pytest
from roll_energy import LEVERS, PATTI, PATTI_TANK, THESIS_SHIP, THESIS_TANK, bounded_starts, energy
from scipy.integrate import simpson

from tools.thesis.reference import after_impact, simulate_reference
from utank_hil.dynamics import RollModel, RollShip, Tank, coupled_model
from utank_hil.dynamics.valves import air_valve_loss, duct_valve_loss
from utank_hil.dynamics.wrench import tank_wrench, water_moments

PAIRS = {
    "thesis_first": (THESIS_SHIP, THESIS_TANK),
    "patti_b": (PATTI, PATTI_TANK),
    "levers": (LEVERS, THESIS_TANK),
}
REST = np.zeros((1, 4))


def worst_drift(ship, tank, start, duration_s):
    run = simulate_reference(RollModel(ship, tank), duration_s, start, tolerance=1e-12)
    assert run.capsized_s == np.inf
    values = energy(ship, tank, run.state)
    return np.ptp(values) / (values[0] - energy(ship, tank, REST)[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", PAIRS)
def test_energy_is_constant_at_large_angles(name):
    ship, tank = PAIRS[name]
    for start in bounded_starts(ship, tank, 2, np.random.default_rng(4)):
        assert worst_drift(ship, tank, start, 50.0) < 1e-10


@pytest.mark.evidence
@pytest.mark.parametrize("name", PAIRS)
def test_energy_is_constant_to_1e_9_over_1000_s(name):
    ship, tank = PAIRS[name]
    for start in bounded_starts(ship, tank, 3, np.random.default_rng(5)):
        assert worst_drift(ship, tank, start, 1000.0) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_friction_and_strikes_never_raise_the_energy(restitution):
    ship = replace(PATTI, damping_nms_rad=3e3, quadratic_damping_nms2_rad2=1e5)
    tank = replace(
        PATTI_TANK, damping_ratio=0.05, quadratic_loss=1.0, headroom_m=0.4, restitution=restitution
    )
    start = (0.35, 0.0, -0.35, 0.0)
    run = simulate_reference(RollModel(ship, tank), 60.0, start, tolerance=1e-11)
    values = energy(ship, tank, run.state)
    assert len(run.impacts) >= 3
    assert np.abs(run.state[:, 2]).max() <= 0.4
    assert np.diff(values).max() <= 1e-8 * values[0]
    assert values[-1] < values[0]


def test_elastic_strikes_keep_the_energy():
    tank = replace(PATTI_TANK, headroom_m=0.4)
    run = simulate_reference(RollModel(PATTI, tank), 60.0, (0.35, 0.0, -0.35, 0.0))
    values = energy(PATTI, tank, run.state)
    assert len(run.impacts) > 5
    assert np.ptp(values) < 1e-9 * (values[0] - energy(PATTI, tank, REST)[0])


def test_pump_and_wave_power_balance_the_energy_and_the_friction():
    ship = replace(THESIS_SHIP, damping_nms_rad=4.87e7, quadratic_damping_nms2_rad2=2e8)
    tank = replace(THESIS_TANK, damping_ratio=0.1, quadratic_loss=2.0)

    def pressure(t):
        return 2e4 * np.sin(0.55 * t)

    def moment(t):
        return 3e7 * np.cos(0.4 * t)

    run = simulate_reference(
        RollModel(ship, tank),
        40.0,
        (0.3, 0.0, 1.0, 0.0),
        pressure_pa=pressure,
        wave_moment_nm=moment,
        samples=20001,
    )
    t, (roll_rate, level_rate) = run.time_s, run.state[:, [1, 3]].T
    speed = 17.11 / 6.22 * level_rate
    losses = (
        4.87e7 * roll_rate**2
        + 2e8 * np.abs(roll_rate) ** 3
        + 17.11 * tank.loss_pa_per_m_s * level_rate**2
        + 2.0 * 500 * np.abs(speed) * speed * 17.11 * level_rate
    )
    power = moment(t) * roll_rate + pressure(t) * 17.11 * level_rate - losses
    values = energy(ship, tank, run.state)
    gained = values[-1] - values[0]
    assert abs(gained) > 1e6
    assert simpson(power, x=t) == pytest.approx(gained, rel=1e-7)
    assert run.impacts == ()


def test_linearized_it_is_the_linear_model():
    ship = replace(PATTI, damping_nms_rad=3e3, quadratic_damping_nms2_rad2=1e5)
    tank = replace(PATTI_TANK, damping_ratio=0.07, quadratic_loss=3.0)
    model, system = RollModel(ship, tank), coupled_model(ship, tank)
    step = 1e-7
    for k, column in enumerate(np.eye(4)):
        slope = (model.derivative(step * column) - model.derivative(-step * column)) / (2 * step)
        np.testing.assert_allclose(slope, system.A[:, k], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(model.derivative(np.zeros(4), 1.0, 0.0), system.B[:, 0], rtol=1e-12)
    np.testing.assert_allclose(model.derivative(np.zeros(4), 0.0, 1.0), system.B[:, 1], rtol=1e-12)


@pytest.mark.parametrize("name", PAIRS)
def test_it_balances_the_six_degree_forces_in_roll(name):
    ship, tank = PAIRS[name]
    ship = replace(
        ship, damping_nms_rad=1e5, quadratic_damping_nms2_rad2=1e6,
        offset_moment_nm=2e4, wind_moment_nm=-3e4,
    )  # fmt: skip
    tank = replace(tank, damping_ratio=0.2, quadratic_loss=2.0, lx_m=-6.0)
    model = RollModel(ship, tank)
    rng = np.random.default_rng(8)
    state = rng.uniform(-1, 1, (1000, 4)) * [1.2, 0.8, tank.height_m, 3]
    pressure, wave = rng.uniform(-1, 1, (2, 1000)) * [[5e4], [1e7]]
    valve = rng.uniform(0, 1e5, 1000)
    _, roll_ddot, _, level_ddot = model.derivative(state, pressure, wave, valve).T
    roll, rate, level, level_rate = state.T
    zero = np.zeros((1000, 3))
    along_x = np.array([1.0, 0, 0])
    _, moment, residual = tank_wrench(
        tank, level, level_rate, level_ddot, zero, rate[:, None] * along_x, zero,
        roll_ddot[:, None] * along_x, roll, 0.0,
    )  # fmt: skip
    hull = (
        wave + 2e4 * np.cos(roll) - 3e4
        - 1e5 * rate - 1e6 * np.abs(rate) * rate - model.restoring.moment_nm(roll)
    )  # fmt: skip
    scale = np.abs(hull).max()
    np.testing.assert_allclose(
        ship.inertia_kg_m2 * roll_ddot, hull + moment[:, 0], rtol=0, atol=1e-12 * scale
    )
    lost = tank.loss_pa_per_m_s * level_rate + (
        tank.quadratic_loss_pa_per_m2_s2 + valve
    ) * level_rate * np.abs(level_rate)
    np.testing.assert_allclose(1000 * residual, pressure - lost, rtol=0, atol=1e-12 * 1e6)


@pytest.mark.parametrize("restitution", [0.0, 0.4])
def test_a_strike_is_an_internal_impulse(restitution):
    """The roll momentum of ship and water stays; the ship gets what the water loses."""
    tank = replace(THESIS_TANK, headroom_m=4.0, restitution=restitution)
    before = np.array([0.3, 0.1, 4.0, 1.5])
    after, impact = after_impact(RollModel(THESIS_SHIP, tank), 7.0, before)
    water = water_moments(tank, 4.0)
    rate_jump, level_jump = after[1] - before[1], after[3] - before[3]
    assert after[3] == pytest.approx(-restitution * 1.5)
    water_change = water.inertia_kgm2[0, 0] * rate_jump + water.swirl_kgm[0] * level_jump
    assert impact.roll_impulse_nms == pytest.approx(-water_change, rel=1e-12)
    assert impact.roll_impulse_nms == pytest.approx(
        THESIS_SHIP.inertia_kg_m2 * rate_jump, rel=1e-12
    )
    lost = np.diff(energy(THESIS_SHIP, tank, np.array([before, after])))[0]
    mean_speed = (before[3] + after[3]) / 2
    assert lost == pytest.approx(impact.stop_impulse_ns * mean_speed, rel=1e-6)


def test_pressed_against_the_stop_the_water_stays_until_pulled_away():
    """A held pump pressure presses the water up; it stays at the roof until the pump lets go."""
    tank = replace(THESIS_TANK, damping_ratio=0.3, headroom_m=0.5, restitution=0.0)
    ship = replace(THESIS_SHIP, damping_nms_rad=2e8)
    run = simulate_reference(
        RollModel(ship, tank),
        100.0,
        np.zeros(4),
        pressure_pa=lambda t: 3e4 * 0.5 * (1 - np.tanh(t - 60)),
        tolerance=1e-10,
    )
    level = run.state[:, 2]
    held = (run.time_s > 20) & (run.time_s < 55)
    np.testing.assert_allclose(level[held], 0.5, atol=1e-9)
    assert np.abs(run.state[held, 3]).max() == 0
    assert level[-1] < 0.45


@pytest.mark.parametrize(
    "ship",
    [replace(LEVERS, wind_moment_nm=6e6), replace(LEVERS, offset_moment_nm=6e6)],
    ids=["wind", "offset"],
)
def test_steady_moments_heel_the_ship_to_its_equilibrium(ship):
    tank = replace(THESIS_TANK, damping_ratio=0.3, restitution=0.0)
    ship = replace(ship, damping_nms_rad=3e8)
    run = simulate_reference(RollModel(ship, tank), 400.0, np.zeros(4), tolerance=1e-9)
    roll, _, level, _ = run.state[-1]
    assert roll > 0.05
    assert level == pytest.approx(np.tan(roll) * 17.1 / 2, rel=1e-5)
    _, moment, _ = tank_wrench(tank, level, 0, 0, *np.zeros((4, 3)), roll, 0.0)
    heeling = ship.wind_moment_nm + ship.offset_moment_nm * np.cos(roll)
    righting = RollModel(ship, tank).restoring.moment_nm(roll)
    assert heeling + moment[0] == pytest.approx(righting, rel=1e-4)


def test_valve_losses_follow_their_orifice_laws():
    tank = Tank(5, 2, 2, 0.5)
    assert duct_valve_loss(tank, 1.0) == 0
    # half open: all of the speed difference u is lost as a head u^2 / 2; u = (At/Ap) dh/dt
    assert duct_valve_loss(tank, 0.5) == pytest.approx(1000 / 2 * 4**2)
    # jet speed At / (0.6 s A) dh/dt
    assert air_valve_loss(tank, 0.1, 0.5) == pytest.approx(1.225 / 2 * (2 / 0.03) ** 2)


@pytest.mark.parametrize("opening", [0.0, 1.1, float("nan")])
def test_impossible_valve_openings_are_refused(opening):
    tank = Tank(5, 2, 2, 0.5)
    with pytest.raises(ValueError, match="opening"):
        duct_valve_loss(tank, opening)
    with pytest.raises(ValueError, match="opening"):
        air_valve_loss(tank, 0.1, opening)


def test_a_ship_past_its_saddle_is_reported_as_capsized():
    run = simulate_reference(
        RollModel(PATTI, PATTI_TANK), 200.0, (0.5, 0.5, 0, 0), capsize_rad=np.pi / 2
    )
    assert run.capsized_s < 200
    assert run.time_s[-1] <= run.capsized_s


def test_a_ship_is_a_value():
    assert RollModel(PATTI, PATTI_TANK) == RollModel(replace(PATTI), replace(PATTI_TANK))
    with pytest.raises(ValueError, match="inertia_kg_m2"):
        RollShip(-1.0, 1.0)
