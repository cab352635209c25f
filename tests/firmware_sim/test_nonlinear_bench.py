"""What a linear bench does not see: Patti-B's quadratic damping and the curve of her levers."""

import math
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import jobs_of
from firmware_sim.run import RECORD_S, roll_without_tank, run_lockstep
from firmware_sim.scenario import Scenario
from tools.thesis.simulate import simulate
from utank_hil.configuration import load_config
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.tank import negligible

PATTI_B = load_config(Path("configs/scenarios/patti_b.yaml"), Scenario)
SETTLED = round(PATTI_B.settle_s / RECORD_S)


def rms_deg(roll_rad: np.ndarray) -> float:
    return math.degrees(float(np.sqrt(np.mean(roll_rad[SETTLED:] ** 2))))


@pytest.mark.evidence
def test_patti_b_rolls_as_the_simulation_of_the_nonlinear_equations_says() -> None:
    vessel, waves = PATTI_B.vessel, PATTI_B.wave_moment(1)
    rows = round(PATTI_B.duration_s / RECORD_S)
    bare, capsized_s = roll_without_tank(PATTI_B, 1, rows)
    assert capsized_s == math.inf
    job = next(iter(jobs_of(PATTI_B, 1, PATTI_B.duration_s)))
    passive = run_lockstep(job).column("true_roll_rad")
    # on the bench the pump is there, held at zero pressure
    for found, tank, off in ((bare, negligible(vessel.tank), 1e-3), (passive, vessel.tank, 1e-2)):
        model = RollModel(vessel.ship, tank)
        run = simulate(model, PATTI_B.duration_s, wave=waves, step_s=0.01, record_every=5)
        assert rms_deg(found) == pytest.approx(rms_deg(run.state[:-1, 0]), rel=off)
    assert rms_deg(bare) == pytest.approx(4.61, abs=0.01)
    assert rms_deg(passive) == pytest.approx(1.60, abs=0.01)
