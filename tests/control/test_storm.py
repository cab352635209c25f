"""The default designs in the storm: a quarter less roll than the passive tank, within limits.

The loop is closed by hand here: exact plant on a 10 ms grid, 50 ms of delay, 0.1 s of lag, sensor
noise and quantization, level observer and limiter; no bus and no nodes.
"""

from pathlib import Path

import numpy as np
import pytest
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL

from utank_hil.control import CommandLimiter, DesignPlant, LevelObserver, PumpLimits
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.sea import EffectiveSlope, Sea, load_ndbc

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
STEP_S, DELAY_STEPS, LAG_S, WARM_UP_S, JUDGED_S = 0.01, 5, 0.1, 200, 1200
SPECTRA = Path(__file__).parents[2] / "configs/seas/ndbc_41010_2019-02_spectral_density.txt"


@pytest.fixture(scope="module")
def wave_moment():
    sea = Sea.irregular(load_ndbc(SPECTRA).at("2019-02-10T05:40"), seed=7)
    moment = sea.roll_moment(SHIP.stiffness_nm_rad, EffectiveSlope(0.5))
    return moment.series(STEP_S, round((JUDGED_S + WARM_UP_S) / STEP_S))


def storm(wave_moment, design=None):
    """Roll (rad), level (m) and command (Pa) after `WARM_UP_S`; without a design, passive."""
    model = coupled_model(SHIP, TANK)
    chain = np.zeros((5, 5))
    chain[:4, :4], chain[:4, 4], chain[4, 4] = model.A, model.B[:, 0], -1 / LAG_S
    inputs = np.zeros((5, 2))
    inputs[4, 0], inputs[:4, 1] = 1 / LAG_S, model.B[:, 1]
    advance = np.hstack(transition_and_step(chain, inputs, STEP_S))
    rng = np.random.default_rng(0)
    limiter, observer = CommandLimiter(PumpLimits(), TANK, 0.02), LevelObserver(TANK, 0.02)
    controller = (
        None if design is None else design.law(DesignPlant(SHIP, TANK, 0.05, LAG_S)).controller()
    )
    state, desired, command = np.zeros(7), 0.0, 0.0
    on_its_way, rows = [0.0] * DELAY_STEPS, []
    for k, moment in enumerate(wave_moment):
        if controller and k % 2 == 0:
            observer.update(round(state[2] + 5e-3 * rng.normal(), 3), state[4])
            if k % 20 == 0:
                roll = round((state[0] + 3e-4 * rng.normal()) / 1e-4) * 1e-4
                seen = {"roll_rad": roll, "level_m": observer.level_m}
                y = np.array([seen[name] for name in design.predictor.measured])
                controller.applied(np.array([limiter.mean_since_last_call()]))
                desired = float(controller.step(y)[0])
            command = limiter.limit(desired, observer.level_m, observer.rate_m_s)
        on_its_way.append(command)
        rows.append((state[0], state[2], command))
        state[5], state[6] = on_its_way.pop(0), moment
        state[:5] = advance @ state
    return np.array(rows[round(WARM_UP_S / STEP_S) :]).T


@pytest.mark.evidence("dpc")
@pytest.mark.slow
@pytest.mark.parametrize("design", [GPC_ROLL, DPC_ROLL_LEVEL], ids=["gpc", "dpc"])
def test_roll_falls_by_a_quarter_within_the_limits(wave_moment, design):
    passive, _, _ = storm(wave_moment)
    roll, level, command = storm(wave_moment, design)
    assert np.std(roll) < 0.76 * np.std(passive)
    assert np.abs(level).max() < 4.0
    assert np.abs(command).max() <= 50e3
    assert np.abs(np.diff(command[::2])).max() <= 100e3 * 0.02 * (1 + 1e-9)
