import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roll_energy import energy
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from firmware_sim import plant_kernel as kernel
from firmware_sim.plant import Plant
from tools.thesis.reference import simulate_reference
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.pump import AT_REST, pump_coast, pump_step
from utank_hil.dynamics.tank import negligible
from utank_hil.sea import Harmonics

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
CALM = Harmonics(np.zeros(1), np.full(1, 0.5), np.zeros(1))
SWELL = Harmonics(
    np.array([2.1e7, -1.3e7, 0.4e7]), np.array([0.45, 0.61, 1.9]), np.array([0.3, 2.0, -1.0])
)
STEP_S = 1e-3


def irregular(scale: float) -> Harmonics:
    return Harmonics(scale * SWELL.amplitude, SWELL.frequency_rad_s, SWELL.phase_rad)


SMALL = 1e-5  #: Share of waves and pressure at which the ship is linear to 1e-9.


def plant_in(sea: Harmonics) -> Plant:
    return Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, sea)


def state_of(plant: Plant) -> tuple[float, ...]:
    return (
        plant.roll_rad,
        plant.roll_rate_rad_s,
        plant.level_m,
        plant.flow_m3_s,
        plant.pressure_pa,
        plant.pump_speed_rad_s,
        plant.pump_power_w,
        plant.pump_energy_j,
        plant.wave_moment_nm,
    )


class ExactShip:
    """Ship and tank with the waves as oscillators of their own: exact while the pressure holds.

    Built from mass, damping and stiffness matrices and a matrix exponential; q = (roll, level).
    """

    def __init__(self, sea: Harmonics) -> None:
        mass, damping, stiffness = coupled_matrices(VESSEL.ship, VESSEL.tank)
        inverse = np.linalg.inv(mass)
        waves = len(sea.amplitude)
        a = np.zeros((5 + 2 * waves, 5 + 2 * waves))
        a[:2, 2:4] = np.eye(2)
        a[2:4, :2] = -inverse @ stiffness
        a[2:4, 2:4] = -inverse @ damping
        a[2:4, 4] = inverse @ [0.0, VESSEL.tank.reservoir_area_m2]  # the held pressure
        self.x = np.zeros(len(a))
        for n, (amplitude, omega, phase) in enumerate(
            zip(sea.amplitude, sea.frequency_rad_s, sea.phase_rad, strict=True)
        ):
            cosine = 5 + 2 * n
            a[2:4, cosine] = inverse @ [1.0, 0.0]
            a[cosine, cosine + 1], a[cosine + 1, cosine] = -omega, omega
            self.x[cosine : cosine + 2] = amplitude * math.cos(phase), amplitude * math.sin(phase)
        self._step = expm(a * STEP_S)

    @property
    def flow_m3_s(self) -> float:
        return float(self.x[3] * VESSEL.tank.reservoir_area_m2)

    def step(self, pressure_pa: float) -> None:
        self.x[4] = pressure_pa
        self.x = self._step @ self.x


@pytest.mark.slow
@pytest.mark.parametrize("enabled", [True, False])
def test_plant_equals_a_matrix_exponential_with_the_same_moment_and_pump(enabled: bool) -> None:
    plant, exact = plant_in(irregular(SMALL)), ExactShip(irregular(SMALL))
    coefficients, pump, energy_j = VESSEL.pump.coefficients, AT_REST, 0.0
    plant.advance(0)
    largest = np.zeros(4)
    for tick in range(2500):
        setpoint_pa = SMALL * 30e3 * math.sin(0.6 * tick * 0.01)
        plant.drive_pump(setpoint_pa, enabled=enabled)
        plant.advance((tick + 1) * TICK_NS)
        for _ in range(10):
            if enabled:
                pump = pump_step(pump, setpoint_pa, exact.flow_m3_s, STEP_S, coefficients)
            else:
                pump = pump_coast(pump, exact.flow_m3_s, STEP_S, coefficients)
            energy_j += pump.power_w * STEP_S
            exact.step(pump.pressure_pa)
        found = np.array([plant.roll_rad, plant.level_m, plant.roll_rate_rad_s])
        largest[:3] = np.maximum(largest[:3], np.abs(found))
        # the moment is interpolated, the rest is rounding and the ship's own small angles
        np.testing.assert_allclose(found, exact.x[[0, 1, 2]], rtol=0, atol=SMALL * 1e-9)
    assert largest[0] > SMALL * 0.02
    assert largest[1] > SMALL * 0.3
    assert plant.pump_speed_rad_s == pytest.approx(pump.speed_rad_s, rel=1e-6)
    assert plant.pressure_pa == pytest.approx(pump.pressure_pa, rel=1e-6, abs=SMALL * 1e-3)
    assert plant.pump_energy_j == pytest.approx(energy_j, rel=1e-6)


def test_imposed_pressure_acts_as_it_is_and_its_work_is_the_waters() -> None:
    plant, exact = plant_in(irregular(SMALL)), ExactShip(irregular(SMALL))
    plant.advance(0)
    work_j, rotor = 0.0, AT_REST
    for tick in range(1500):
        pressure_pa = SMALL * 60e3 * math.sin(0.6 * tick * 0.01)
        plant.impose_pressure(pressure_pa)
        plant.advance((tick + 1) * TICK_NS)
        for _ in range(10):
            work_j += pressure_pa * exact.flow_m3_s * STEP_S
            rotor = pump_coast(rotor, exact.flow_m3_s, STEP_S, VESSEL.pump.coefficients)
            exact.step(pressure_pa)
        assert plant.pressure_pa == pressure_pa
        assert [plant.roll_rad, plant.level_m] == pytest.approx(exact.x[:2], abs=SMALL * 1e-9)
    assert plant.pump_energy_j == pytest.approx(work_j, rel=1e-6)
    # the rotor turned with the water, so that there is no jolt when the pressure ends
    assert plant.pump_speed_rad_s == pytest.approx(rotor.speed_rad_s, rel=1e-6)


def test_imposed_pressure_may_be_above_the_pumps_limit_and_the_rotor_turns_with_the_water() -> None:
    plant = plant_in(SWELL)
    plant.advance(0)
    largest_pa = 0.0
    for tick in range(1500):
        pressure_pa = 60e3 * math.sin(0.6 * tick * 0.01)
        plant.impose_pressure(pressure_pa)
        plant.advance((tick + 1) * TICK_NS)
        assert plant.pressure_pa == pressure_pa
        largest_pa = max(largest_pa, abs(pressure_pa))
    assert largest_pa > VESSEL.pump.max_pressure_pa
    assert abs(plant.pump_speed_rad_s) > 1.0


def mechanical_energy_j(plant: Plant, vessel: Vessel = VESSEL) -> float:
    """From the particles of the water and the ship's potential, not from the plant's equations."""
    rate_m_s = plant.flow_m3_s / vessel.tank.reservoir_area_m2
    state = [plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, rate_m_s]
    upright = energy(vessel.ship, vessel.tank, [[0.0] * 4])
    return float((energy(vessel.ship, vessel.tank, [state]) - upright)[0])


def test_shaft_work_pays_for_motion_friction_and_losses() -> None:
    plant = plant_in(CALM)
    plant.advance(0)
    for tick in range(3000):
        plant.drive_pump(25e3 * math.sin(0.55 * tick * 0.01), enabled=True)
        plant.advance((tick + 1) * TICK_NS)
    assert mechanical_energy_j(plant) > 1e6
    assert plant.pump_work_j == pytest.approx(mechanical_energy_j(plant) + plant.losses_j, rel=1e-5)
    rotor_j = VESSEL.pump.inertia_kg_m2 * plant.pump_speed_rad_s**2 / 2
    # slip and blade friction take the rest
    assert plant.pump_energy_j > plant.pump_work_j + rotor_j


def test_with_the_motor_off_and_no_wave_energy_never_grows() -> None:
    plant = plant_in(CALM)
    plant.advance(0)
    for tick in range(1500):
        plant.drive_pump(40e3 * math.sin(0.55 * tick * 0.01), enabled=True)
        plant.advance((tick + 1) * TICK_NS)
    plant.drive_pump(0.0, enabled=False)
    now_ns = 1500 * TICK_NS

    def total_j() -> float:
        rotor_j = VESSEL.pump.inertia_kg_m2 * plant.pump_speed_rad_s**2 / 2
        return mechanical_energy_j(plant) + rotor_j

    before_j = total_j()
    for tick in range(3000):
        plant.advance(now_ns + (tick + 1) * TICK_NS)
        after_j = total_j()
        assert after_j <= before_j * (1 + 1e-6)
        before_j = after_j
    assert plant.pump_energy_j > 0


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.0, 2.0])
def test_wind_and_cargo_heel_the_ship_and_the_water_runs_to_the_low_side(after_s: float) -> None:
    heeled = replace(VESSEL.ship, wind_moment_nm=2.5e5, offset_moment_nm=-5e4)
    plant = Plant(
        lambda time_s: heeled if time_s >= after_s else VESSEL.ship,
        VESSEL.tank,
        VESSEL.pump,
        CALM,
    )
    plant.advance(0)
    for tick in range(80_000):
        plant.drive_pump(0.0, enabled=True)
        plant.advance((tick + 1) * TICK_NS)
        if tick == 199 and after_s:
            assert (plant.roll_rad, plant.level_m) == (0.0, 0.0)
    # hydrostatics: the water is level, and carries its own moment to that side
    level_m = plant.roll_rad * VESSEL.tank.width_m / 2
    assert plant.level_m == pytest.approx(level_m, rel=1e-4)
    _, _, stiffness = coupled_matrices(VESSEL.ship, VESSEL.tank)
    moment_nm = stiffness[0] @ [plant.roll_rad, plant.level_m]
    assert moment_nm == pytest.approx(2e5, rel=1e-4)
    assert plant.roll_rad > 2e5 / VESSEL.ship.stiffness_nm_rad
    assert plant.wave_moment_nm == 0.0


def test_wave_moment_is_the_sum_of_harmonics_after_half_an_hour() -> None:
    plant = plant_in(SWELL)
    scale = float(np.abs(SWELL.amplitude).sum())
    for time_s in (0, 1, 60, 1800):
        plant.advance(round(time_s * 1e9))
        assert plant.wave_moment_nm == pytest.approx(
            float(SWELL.at(float(time_s))), abs=1e-9 * scale
        )


@pytest.mark.parametrize(("omega", "bound"), [(0.5, 2e-11), (1.0, 3e-10), (3.0, 2e-8)])
def test_interpolated_wave_moment_is_as_exact_as_promised(omega: float, bound: float) -> None:
    weights = kernel.interpolation_weights()
    assert weights.shape == (2 * kernel.STEPS + 1, 4)
    nodes_s = TICK_S * np.array([-1.0, 0.0, 1.0, 2.0])
    at_s = np.linspace(0.0, TICK_S, len(weights))
    for phase in np.linspace(0, 2 * math.pi, 40):
        values = weights @ np.cos(omega * nodes_s + phase)
        np.testing.assert_allclose(values, np.cos(omega * at_s + phase), rtol=0, atol=bound)


@given(jumps=st.lists(st.integers(0, 70_000_000), min_size=1, max_size=20))
def test_late_ticks_lose_nothing_as_long_as_the_pump_holds(jumps: list[int]) -> None:
    late, punctual = plant_in(SWELL), plant_in(SWELL)
    for plant in (late, punctual):
        plant.advance(5)
        plant.drive_pump(20e3, enabled=True)
    now_ns = 5
    for jump_ns in jumps:
        now_ns += jump_ns
        late.advance(now_ns)
    for tick_ns in range(5, now_ns + 1, TICK_NS):
        punctual.advance(tick_ns)
    assert state_of(late) == state_of(punctual)


def test_plant_starts_at_rest_whenever_it_is_first_asked() -> None:
    early, late = plant_in(SWELL), plant_in(SWELL)
    early.advance(0)
    late.advance(987_654_321_000)
    assert state_of(early)[:8] == (0.0,) * 8
    early.advance(200 * TICK_NS)
    late.advance(987_654_321_000 + 200 * TICK_NS)
    assert state_of(early) == state_of(late)


def test_set_point_is_followed_within_the_pumps_lag_and_its_flags_tell_the_limits() -> None:
    plant = plant_in(CALM)
    plant.advance(0)
    pump = VESSEL.pump
    plant.drive_pump(pump.max_pressure_pa, enabled=True)
    plant.advance(TICK_NS)
    assert plant.pressure_limited
    assert plant.rate_limited  # 50 kPa through a lag of 83 ms would be 600 kPa/s
    plant = plant_in(CALM)
    plant.advance(0)
    plant.drive_pump(10e3, enabled=True)
    plant.advance(TICK_NS)
    assert not plant.pressure_limited
    assert not plant.rate_limited
    plant.advance(round(VESSEL.pump.lag_s * 1e9))
    # a first-order lag has come 63 % of the way after its time constant
    assert plant.pressure_pa == pytest.approx(10e3 * (1 - math.exp(-1)), rel=0.15)
    plant.advance(1_000_000_000)
    assert plant.pressure_pa == pytest.approx(10e3, rel=0.02)
    assert not plant.speed_limited
    assert not plant.power_limited


def test_rotor_that_the_water_drives_beyond_its_speed_is_at_its_limit() -> None:
    plant = plant_in(Harmonics(np.array([4e8]), np.array([0.5]), np.zeros(1)))
    plant.advance(0)
    beyond = 0
    for tick in range(1, 6000, 10):
        plant.advance(tick * TICK_NS)
        if abs(plant.pump_speed_rad_s) > 1.05 * VESSEL.pump.max_speed_rad_s:
            beyond += 1
            assert plant.speed_limited
            assert not plant.power_limited
    assert beyond


PATTI_B = load_config(Path("configs/ships/patti_b.yaml"), Vessel)
NAVAL = load_config(Path("configs/ships/naval_vessel.yaml"), Vessel)
LOSSY = replace(VESSEL.tank, quadratic_loss=2.0, restitution=0.3)
BEATING = Harmonics(
    np.array([1.3e5, -0.9e5, 0.5e5]), np.array([0.60, 0.71, 1.4]), np.array([0.3, 2.0, -1.0])
)


def history(plant: Plant, seconds: float) -> np.ndarray:
    """Roll and level at every second."""
    found = []
    for now_s in range(round(seconds) + 1):
        plant.advance(now_s * 1_000_000_000)
        found.append([plant.roll_rad, plant.level_m])
    return np.array(found)


@pytest.mark.evidence("Patti-B, irregular", "the first ship in moderate waves")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("vessel", "sea", "most_rad"),
    [
        pytest.param(VESSEL, irregular(1.15), 0.08, id="the first ship, irregular"),
        pytest.param(VESSEL, irregular(1.0), 0.07, id="the first ship in moderate waves"),
        pytest.param(
            PATTI_B,
            Harmonics(np.array([8.6e4]), np.array([0.6]), np.array([0.0])),
            0.3,
            id="Patti-B near capsizing, regular",
        ),
        pytest.param(
            PATTI_B,
            Harmonics(0.35 * BEATING.amplitude, BEATING.frequency_rad_s, BEATING.phase_rad),
            0.2,
            id="Patti-B, irregular",
        ),
    ],
)
def test_plant_follows_an_adaptive_integration_of_the_nonlinear_equations(
    vessel: Vessel, sea: Harmonics, most_rad: float
) -> None:
    seconds = 58
    tank = replace(vessel.tank, quadratic_loss=1.5)
    model = RollModel(vessel.ship, tank)
    reference = simulate_reference(
        model,
        seconds,
        (0.0, 0.0, 0.0, 0.0),
        wave_moment_nm=lambda t: float(sea.at(t)),
        samples=seconds + 1,
        tolerance=1e-10,
    )
    assert not reference.impacts
    assert np.abs(reference.state[:, 0]).max() > most_rad
    found = history(Plant(vessel.ship, tank, None, sea), seconds)
    rms = np.sqrt((reference.state[:, [0, 2]] ** 2).mean(axis=0))
    off = np.sqrt(((found - reference.state[:, [0, 2]]) ** 2).mean(axis=0))
    # asked for is a thousandth
    assert (off < 1e-6 * rms).all()


def test_water_strikes_its_limits_as_in_the_adaptive_integration() -> None:
    sea = irregular(5.0)
    model = RollModel(VESSEL.ship, LOSSY)
    seconds = 30
    reference = simulate_reference(
        model,
        seconds,
        (0.0, 0.0, 0.0, 0.0),
        wave_moment_nm=lambda t: float(sea.at(t)),
        samples=seconds + 1,
        tolerance=1e-10,
    )
    plant = Plant(VESSEL.ship, LOSSY, None, sea)
    found = history(plant, seconds)
    assert plant.strikes == len(reference.impacts) > 2
    largest = max(abs(impact.roll_impulse_nms) for impact in reference.impacts)
    assert plant.max_strike_impulse_nms == pytest.approx(largest, rel=1e-5)
    np.testing.assert_allclose(found, reference.state[:, [0, 2]], atol=1e-5)
    assert np.abs(found[:, 1]).max() <= LOSSY.level_limit_m


@pytest.mark.parametrize("valve", [0.0, 3e4])
def test_work_of_waves_and_pump_is_energy_and_losses_strikes_included(valve: float) -> None:
    ship = replace(
        VESSEL.ship, quadratic_damping_nms2_rad2=2e8, restoring_odd_nm=(-1e8,), wind_moment_nm=5e6
    )
    vessel = VESSEL.model_copy(update={"tank": LOSSY, "ship": ship})
    plant = Plant(ship, LOSSY, vessel.pump, irregular(4.0))
    plant.advance(0)
    plant.set_valve_loss(valve)
    for tick in range(60_000):
        plant.drive_pump(40e3 * math.sin(0.55 * tick * 0.01), enabled=tick % 3000 < 2000)
        plant.advance((tick + 1) * TICK_NS)
    assert plant.strikes > 5 or valve
    work_j = plant.wave_work_j + plant.pump_work_j
    gained_j = mechanical_energy_j(plant, vessel) + plant.losses_j
    assert work_j == pytest.approx(gained_j, abs=1e-6 * plant.wave_work_j)


def test_ship_that_passes_ninety_degrees_has_capsized_and_stays() -> None:
    sea = Harmonics(np.array([3e5]), np.array([0.6]), np.array([0.0]))
    plant = Plant(PATTI_B.ship, PATTI_B.tank, PATTI_B.pump, sea)
    assert plant.capsized_s == math.inf
    history(plant, 60)
    assert 1 < plant.capsized_s < 60
    assert abs(plant.roll_rad) >= math.pi / 2
    assert plant.roll_rate_rad_s == plant.flow_m3_s == 0
    before = state_of(plant)[:4]
    plant.advance(70_000_000_000)
    assert state_of(plant)[:4] == before
    reference = simulate_reference(
        RollModel(PATTI_B.ship, PATTI_B.tank),
        60.0,
        (0.0, 0.0, 0.0, 0.0),
        wave_moment_nm=lambda t: float(sea.at(t)),
        capsize_rad=math.pi / 2,
    )
    bare = Plant(PATTI_B.ship, PATTI_B.tank, None, sea)
    history(bare, 60)
    assert bare.capsized_s == pytest.approx(reference.capsized_s, abs=2e-3)


def test_ship_without_her_tank_is_the_roll_equation_alone() -> None:
    sea = irregular(2.0)
    ship = replace(VESSEL.ship, quadratic_damping_nms2_rad2=2e8, wind_moment_nm=1e7)
    plant = Plant(ship, negligible(VESSEL.tank), None, sea)
    found = history(plant, 60)[:, 0]

    def slope(time_s: float, state: np.ndarray) -> list[float]:
        roll, rate = state
        damping = ship.damping_nms_rad * rate + 2e8 * abs(rate) * rate
        moment = float(sea.at(time_s)) + 1e7 - damping - ship.stiffness_nm_rad * roll
        return [rate, moment / ship.inertia_kg_m2]

    run = solve_ivp(
        slope, (0, 60), [0.0, 0.0], "DOP853", t_eval=np.arange(61), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(found, run.y[0], rtol=0, atol=1e-6 * np.abs(found).max())


def test_tank_without_a_pump_has_no_pressure_and_no_rotor() -> None:
    without, zero = Plant(VESSEL.ship, VESSEL.tank, None, SWELL), plant_in(SWELL)
    for plant in (without, zero):
        plant.advance(0)
        plant.drive_pump(40e3, enabled=plant is without)
        plant.advance(20_000_000_000)
    assert without.pressure_pa == without.pump_speed_rad_s == without.pump_energy_j == 0
    # a rotor that turns freely is carried along, and changes the water's motion
    assert zero.pump_speed_rad_s != 0
    assert without.level_m != zero.level_m


def test_the_linear_plant_is_the_limit_of_small_motions():
    def rolls(scale, linear):
        waves = irregular(scale)
        plant = Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, waves, linear=linear)
        found = []
        for tick in range(6000):
            plant.advance(tick * TICK_NS)
            found.append([plant.roll_rad, plant.level_m])
        return np.array(found)

    linear = rolls(1e-4, True)
    np.testing.assert_allclose(rolls(1e-4, False), linear, rtol=0, atol=1e-6 * np.abs(linear).max())
    assert np.abs(rolls(4.0, False) - rolls(4.0, True)).max() > 0.01
