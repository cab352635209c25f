import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from firmware_sim import plant_kernel as kernel
from firmware_sim.plant import Plant
from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.pump import AT_REST, pump_coast, pump_step
from utank_hil.sea import Harmonics
from utank_hil.tick import TICK_NS, TICK_S

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
CALM = Harmonics(np.zeros(1), np.full(1, 0.5), np.zeros(1))
SWELL = Harmonics(
    np.array([2.1e7, -1.3e7, 0.4e7]), np.array([0.45, 0.61, 1.9]), np.array([0.3, 2.0, -1.0])
)
STEP_S = 1e-3


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
    plant, exact = plant_in(SWELL), ExactShip(SWELL)
    coefficients, pump, energy_j = VESSEL.pump.coefficients, AT_REST, 0.0
    plant.advance(0)
    largest = np.zeros(4)
    for tick in range(2500):
        setpoint_pa = 30e3 * math.sin(0.6 * tick * 0.01)
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
        # a thousandth of a microradian: the moment is interpolated, the rest is rounding
        np.testing.assert_allclose(found, exact.x[[0, 1, 2]], rtol=0, atol=1e-9)
    assert largest[0] > 0.02
    assert largest[1] > 0.3
    assert plant.pump_speed_rad_s == pytest.approx(pump.speed_rad_s, rel=1e-6)
    assert plant.pressure_pa == pytest.approx(pump.pressure_pa, rel=1e-6, abs=1e-3)
    assert plant.pump_energy_j == pytest.approx(energy_j, rel=1e-6)


def test_imposed_pressure_acts_as_it_is_and_its_work_is_the_waters() -> None:
    plant, exact = plant_in(SWELL), ExactShip(SWELL)
    plant.advance(0)
    work_j, rotor = 0.0, AT_REST
    for tick in range(1500):
        pressure_pa = 60e3 * math.sin(0.6 * tick * 0.01)  # above the emulated pump's own limit
        plant.impose_pressure(pressure_pa)
        plant.advance((tick + 1) * TICK_NS)
        for _ in range(10):
            work_j += pressure_pa * exact.flow_m3_s * STEP_S
            rotor = pump_coast(rotor, exact.flow_m3_s, STEP_S, VESSEL.pump.coefficients)
            exact.step(pressure_pa)
        assert plant.pressure_pa == pressure_pa
        assert [plant.roll_rad, plant.level_m] == pytest.approx(exact.x[:2], abs=1e-9)
    assert plant.pump_energy_j == pytest.approx(work_j, rel=1e-6)
    # the rotor turned with the water, so that there is no jolt when the pressure ends
    assert plant.pump_speed_rad_s == pytest.approx(rotor.speed_rad_s, rel=1e-6)
    assert abs(plant.pump_speed_rad_s) > 1.0


def mechanical_energy_j(plant: Plant) -> float:
    mass, _, stiffness = coupled_matrices(VESSEL.ship, VESSEL.tank)
    q = np.array([plant.roll_rad, plant.level_m])
    v = np.array([plant.roll_rate_rad_s, plant.flow_m3_s / VESSEL.tank.reservoir_area_m2])
    return float(v @ mass @ v + q @ stiffness @ q) / 2


def test_shaft_work_pays_for_motion_friction_and_losses() -> None:
    plant = plant_in(CALM)
    _, damping, _ = coupled_matrices(VESSEL.ship, VESSEL.tank)
    plant.advance(0)
    rates = []
    for tick in range(3000):
        plant.drive_pump(25e3 * math.sin(0.55 * tick * 0.01), enabled=True)
        plant.advance((tick + 1) * TICK_NS)
        v = np.array([plant.roll_rate_rad_s, plant.flow_m3_s / VESSEL.tank.reservoir_area_m2])
        rates.append((v @ damping @ v, plant.pressure_pa * plant.flow_m3_s))
    friction_j, hydraulic_j = np.trapezoid(np.array(rates), dx=0.01, axis=0)
    assert mechanical_energy_j(plant) > 1e6
    assert hydraulic_j == pytest.approx(mechanical_energy_j(plant) + friction_j, rel=2e-3)
    rotor_j = VESSEL.pump.inertia_kg_m2 * plant.pump_speed_rad_s**2 / 2
    assert plant.pump_energy_j > hydraulic_j + rotor_j  # slip and blade friction take the rest


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
    heeled = replace(VESSEL.ship, wind_moment_nm=2.5e7, offset_moment_nm=-5e6)
    upright = VESSEL.ship if after_s else heeled
    plant = Plant(upright, VESSEL.tank, VESSEL.pump, CALM)
    plant.change_ship(heeled, round(after_s * 1e9))
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
    assert moment_nm == pytest.approx(2e7, rel=1e-4)
    assert plant.roll_rad > 2e7 / VESSEL.ship.stiffness_nm_rad
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
