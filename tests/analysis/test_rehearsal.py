import numpy as np
import pytest
from recorded_ship import CONFIGURED, DELAY_S, LAG_S, TANK

from utank_hil.analysis.closed_loop import closed_loop_response
from utank_hil.analysis.rehearsal import rehearse
from utank_hil.control import DPC_ROLL_LEVEL, pump_model
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.sampling import sample

MEASURED = ("roll_rad", "level_m")
PLANT = sample(pump_model(CONFIGURED, TANK, MEASURED), 0.2, DELAY_S, LAG_S)
LAW = DPC_ROLL_LEVEL.law(CONFIGURED, TANK)
OMEGA = np.array([0.5])


def _record(pressure_pa: float) -> np.ndarray:
    """Steady waves' part of the outputs, plus what a pump pushing at random does."""
    time_s = 0.2 * np.arange(6000)
    passive = closed_loop_response(None, coupled_model(CONFIGURED, TANK), MEASURED, OMEGA)[0][0]
    waves = np.real(1e7 * np.outer(np.exp(1j * OMEGA[0] * time_s), passive[[0, 2]]))
    u = pressure_pa * np.random.default_rng(1).standard_normal(len(time_s))
    state, outputs = np.zeros(len(PLANT.A)), np.empty((len(u), 2))
    for k, value in enumerate(u):
        outputs[k] = PLANT.C @ state + PLANT.D[:, 0] * value
        state = PLANT.A @ state + PLANT.B[:, 0] * value
    return np.column_stack([u, waves + outputs])


@pytest.mark.parametrize("pressure_pa", [0.0, 1e4])
def test_rehearsed_roll_is_that_of_the_frequency_response(pressure_pa: float) -> None:
    model = coupled_model(CONFIGURED, TANK)
    passive = closed_loop_response(None, model, MEASURED, OMEGA)[0][0, 0]
    motions, pressure = closed_loop_response(LAW, model, MEASURED, OMEGA, DELAY_S, LAG_S)
    result = rehearse(LAW, PLANT, _record(pressure_pa), 0, 1e9)
    assert result.passive_rad == pytest.approx(1e7 * abs(passive) / np.sqrt(2), rel=0.01)
    assert result.roll_rad == pytest.approx(1e7 * abs(motions[0, 0]) / np.sqrt(2), rel=0.02)
    assert result.pressure_pa == pytest.approx(1e7 * abs(pressure[0]) / np.sqrt(2), rel=0.02)


def test_pressure_limit_holds_and_a_gap_is_bridged() -> None:
    record = _record(0.0)
    record[2000:2010] = np.nan
    result = rehearse(LAW, PLANT, record, 0, 100.0)
    assert result.pressure_pa <= 100.0
    assert result.roll_rad == pytest.approx(result.passive_rad, rel=0.05)
