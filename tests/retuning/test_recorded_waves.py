import numpy as np
import pytest
from recorded_ship import CONFIGURED, DELAY_S, LAG_S, TANK, ship_of
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL

from utank_hil.analysis.loop.margins import closed_loop_response
from utank_hil.base.arrays import FloatArray
from utank_hil.control import CommandLimiter, DesignPlant, PumpLimits, pump_model
from utank_hil.control.interface import LinearLaw
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.retuning.redesign import RecordedWaves, tank_motion

pytestmark = pytest.mark.slow

MEASURED = ("roll_rad", "level_m")
PLANT = sample(pump_model(CONFIGURED, TANK, MEASURED), 0.2, DELAY_S, LAG_S)
LAW = DPC_ROLL_LEVEL.law(DesignPlant(CONFIGURED, TANK))
OMEGA = np.array([0.5])
UNLIMITED = PumpLimits(pressure_pa=1e9, rate_pa_s=1e12, level_m=1e6)


def _record(pressure_pa: float) -> np.ndarray:
    """Steady waves' part of the outputs, plus what a pump pushing at random does."""
    time_s = 0.2 * np.arange(6000)
    passive = closed_loop_response(None, DesignPlant(CONFIGURED, TANK), MEASURED, OMEGA)[0][0]
    waves = np.real(1e7 * np.outer(np.exp(1j * OMEGA[0] * time_s), passive[[0, 2]]))
    u = pressure_pa * np.random.default_rng(1).standard_normal(len(time_s))
    state, outputs = np.zeros(len(PLANT.A)), np.empty((len(u), 2))
    for k, value in enumerate(u):
        outputs[k] = PLANT.C @ state + PLANT.D[:, 0] * value
        state = PLANT.A @ state + PLANT.B[:, 0] * value
    return np.column_stack([u, waves + outputs])


def _waves(
    record: FloatArray,
    limits: PumpLimits,
    ship: RollShip = CONFIGURED,
    measured: tuple[str, ...] = MEASURED,
) -> RecordedWaves:
    return RecordedWaves(record, DesignPlant(ship, TANK, DELAY_S, LAG_S, limits), measured, 0.2)


@pytest.mark.evidence("0.0", "10000.0")
@pytest.mark.parametrize("pressure_pa", [0.0, 1e4])
def test_simulated_roll_is_that_of_the_frequency_response(pressure_pa: float) -> None:
    model = DesignPlant(CONFIGURED, TANK, DELAY_S, LAG_S)
    passive = closed_loop_response(None, model, MEASURED, OMEGA)[0][0, 0]
    motions, pressure = closed_loop_response(LAW, model, MEASURED, OMEGA)
    result = _waves(_record(pressure_pa), UNLIMITED).simulate(LAW)
    assert result.passive_roll_rad == pytest.approx(1e7 * abs(passive) / np.sqrt(2), rel=0.01)
    assert result.roll_rad == pytest.approx(1e7 * abs(motions[0, 0]) / np.sqrt(2), rel=0.02)
    assert result.pressure_pa == pytest.approx(1e7 * abs(pressure[0]) / np.sqrt(2), rel=0.02)


def test_pressure_limit_holds_and_a_gap_is_bridged() -> None:
    record = _record(0.0)
    record[2000:2010] = np.nan
    result = _waves(record, PumpLimits(pressure_pa=100.0)).simulate(LAW)
    assert result.pressure_pa <= 100.0
    assert result.roll_rad == pytest.approx(result.passive_roll_rad, rel=0.05)


def _sailed(
    ship: RollShip, law: LinearLaw | None, measured: tuple[str, ...], moment_nm: FloatArray
) -> FloatArray:
    """States (N, 4) each 0.2 s with law and limiter on the ship herself, tick by tick of 10 ms."""
    a, b = state_matrices(ship, TANK)
    tick_s = 0.01
    # pressure through lag and delay, and the moment; exact for inputs held over a tick
    whole = np.zeros((7, 7))
    whole[:4, :4], whole[:4, 4], whole[:4, 5] = a, b[:, 0], b[:, 1]
    whole[4, [4, 6]] = -1 / LAG_S, 1 / LAG_S
    values, vectors = np.linalg.eig(whole)
    step = np.real(vectors @ np.diag(np.exp(values * tick_s)) @ np.linalg.inv(vectors))
    controller = None if law is None else law.controller()
    limiter = CommandLimiter(PumpLimits(), TANK, tick_s)
    state, commands = np.zeros(5), [0.0] * round(DELAY_S / tick_s)
    seen, desired_pa = [], 0.0
    index = [STATES.index(name) for name in measured]
    for k, nm in enumerate(moment_nm):
        if k % 20 == 0:
            seen.append(state[:4].copy())
            if controller is not None:
                controller.applied(np.full(1, limiter.mean_since_last_call()))
                desired_pa = float(controller.step(state[index])[0])
        if controller is not None:
            limiter.limit(desired_pa, float(state[2]), float(state[3]))
        commands.append(limiter.command_pa)
        state = (step @ np.concatenate([state, [nm, commands.pop(0)]]))[:5]
    return np.array(seen)


def _storm_nm(ship: RollShip, seed: int) -> FloatArray:
    """A moment that drives pump and water to their limits, 500 s."""
    rng = np.random.default_rng(seed)
    omega = rng.uniform(0.35, 1.0, 60)
    time_s = 0.01 * np.arange(50_000)
    waves = np.zeros(len(time_s))
    for w, phase in zip(omega, rng.uniform(0, 2 * np.pi, len(omega)), strict=True):
        waves += np.cos(w * time_s + phase)
    return 3.3e-3 * ship.stiffness_nm_rad * waves


@pytest.mark.evidence("7.5-2-1.8-False", "12.57-1-1.8-True", "10.0-2-1.4-True")
@pytest.mark.parametrize(
    ("period_s", "outputs", "size", "limits_matter"),
    [(7.5, 1, 1.0, False), (7.5, 2, 1.8, False), (12.57, 1, 1.8, True), (10.0, 2, 1.4, True)],
)
def test_simulation_through_the_limits_predicts_the_voyage(
    period_s: float, outputs: int, size: float, limits_matter: bool
) -> None:
    ship, measured = ship_of(period_s), MEASURED[:outputs]
    design = DPC_ROLL_LEVEL if outputs == 2 else GPC_ROLL
    moment_nm = size * _storm_nm(ship, 1)
    passive = _sailed(ship, None, measured, moment_nm)
    record = np.column_stack([np.zeros(len(passive)), passive[:, [0, 2][:outputs]]])
    law = design.law(DesignPlant(CONFIGURED, TANK))
    truth = np.sqrt(np.mean(_sailed(ship, law, measured, moment_nm)[300:, 0] ** 2))
    assert _waves(record, PumpLimits(), ship, measured).simulate(law).roll_rad == pytest.approx(
        truth, rel=0.01
    )
    free = (
        _waves(record, PumpLimits(rate_pa_s=1e9, level_m=1e3), ship, measured)
        .simulate(law)
        .roll_rad
    )
    assert bool(free < 0.9 * truth) is limits_matter


def test_water_follows_the_roll_by_the_tanks_own_equation() -> None:
    passive = _sailed(CONFIGURED, None, MEASURED, _storm_nm(CONFIGURED, 2))
    found = tank_motion(CONFIGURED, TANK, passive[:, 0], 0.2)
    middle = slice(300, -100)  # the record does not close on itself
    for column, state in ((0, 2), (1, 3)):
        error = np.std((found[:, column] - passive[:, state])[middle])
        assert error < 0.05 * np.std(passive[middle, state])
