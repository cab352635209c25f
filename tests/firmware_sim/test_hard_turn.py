"""A sound ship that turns hard on the bench: no sensor, gauge or drive is called faulty."""

import math
from pathlib import Path

import pytest
import yaml

from firmware_sim.bench import jobs_of
from firmware_sim.run import run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.canbus import Fault
from utank_hil.configuration import load_config

SHIPS = Path("configs/ships").resolve()
CONTROLLERS = Path("configs/controllers").resolve()
DURATION_S = 200.0


@pytest.mark.parametrize(("seed", "turned_deg"), [(1, 120.0), (2, -120.0)])
@pytest.mark.parametrize("hs_m", [0.3, 1.5])
def test_a_hard_turn_ends_in_nothing_but_what_the_law_does_in_it(seed, turned_deg, hs_m, tmp_path):
    """120 degrees in 40 s at 8.5 m/s: 0.45 m/s^2, which heels the ship by some 4 degrees.

    A law that answers the heel may roll the ship more than its twin, or fill a reservoir.
    """
    file = tmp_path / "turn.yaml"
    scenario = {
        "name": "A hard turn",
        "vessel": str(SHIPS / "thesis_first.yaml"),
        "sea": {
            "kind": "jonswap", "hs_m": hs_m, "tp_s": 9.0, "heading_deg": 100.0, "speed_m_s": 8.5,
            "effective_slope": {"coefficient": 0.7},
        },
        "actual_ship": {"displacement_n": 1.42e8},
        "turning_lever_m": 4.0,
        "voyage": [{"time_s": 60}, {"time_s": 100, "heading_deg": 100.0 + turned_deg}],
        "controllers": {"law": str(CONTROLLERS / "constrained_gpc.yaml")},
        "operator": [{"time_s": 5.0, "action": "arm"}],
        "duration_s": DURATION_S, "settle_s": 20.0, "seed": seed,
    }  # fmt: skip
    file.write_text(yaml.safe_dump(scenario), encoding="utf-8")
    jobs = {job.name: job for job in jobs_of(load_config(file, Scenario), seed, DURATION_S)}
    run = run_lockstep(jobs["law"])
    time_s = run.column("time_s")
    turning = (time_s > 75) & (time_s < 95)
    assert abs(run.column("true_roll_rad")[turning].mean()) > math.radians(1.5)
    found = set(run.column("fault")[time_s > 10])
    assert found <= {Fault.NONE, Fault.ROLL_AMPLIFIED, Fault.LEVEL_LIMIT}
