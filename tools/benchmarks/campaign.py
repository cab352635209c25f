"""A case of the fast simulation against a loop in C of the same law, plant and sea.

Half an hour of the storm with GPC, in processor time of this process; roll as a check that both do
the same. The C loop has no statistics, no sensor noise and no passive ship to compare with.

Example: .venv/bin/python -m tools.benchmarks.campaign
"""

import ctypes
import math
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Final

import numpy as np

from firmware_sim.campaign.simulations import rows_of
from firmware_sim.scenario import Scenario
from tools.printing import command_line, show
from utank_hil.assembly import build_law
from utank_hil.base.compiled import in_use
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import load_config
from utank_hil.control.level_observer import BANDWIDTH_RAD_S
from utank_hil.control.predictive.design import WashoutLaw
from utank_hil.control.predictive.law import PredictiveLaw
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.dynamics.tank import GRAVITY_M_S2

STORM: Final = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "storm.yaml"
SOURCE: Final = Path(__file__).with_name("loop.c")
SECONDS: Final = 1800.0


def roll_in_c(library: ctypes.CDLL, scenario: Scenario, washed: WashoutLaw) -> float:
    """Root mean square of the roll in rad."""
    law = washed.law
    assert isinstance(law, PredictiveLaw)
    plant, tank = scenario.controllers["gpc"].plant, scenario.vessel.tank
    a, b = state_matrices(scenario.ship_at(0.0), tank)
    lagged = np.block([[a, b[:, :1]], [np.zeros((1, 4)), np.full((1, 1), -1 / plant.lag_s)]])
    inputs = np.zeros((5, 2))
    inputs[4, 0], inputs[:4, 1] = 1 / plant.lag_s, b[:, 1]
    step = np.ascontiguousarray(np.hstack(transition_and_step(lagged, inputs, TICK_S)))
    limits, period_s = plant.limits, 2 * TICK_S
    numbers = np.array(
        [limits.pressure_pa, limits.rate_pa_s * TICK_S, limits.level_m, limits.power_w,
         limits.brake_share, limits.sharpness, limits.lookahead_s,
         2 * tank.density_kg_m3 * GRAVITY_M_S2, tank.natural_frequency_rad_s,
         tank.reservoir_area_m2, period_s, math.exp(-BANDWIDTH_RAD_S * period_s),
         tank.density_kg_m3 * tank.effective_length_m, tank.loss_pa_per_m_s]
    )  # fmt: skip
    moment, ticks = scenario.wave_moment(scenario.seed), round(scenario.duration_s / TICK_S)
    arrays = [
        np.ascontiguousarray(each, dtype=float)
        for each in (moment.amplitude, moment.frequency_rad_s, moment.phase_rad,
                     law.input_gains.ravel(), law.output_gains.ravel())
    ]  # fmt: skip
    places = [each.ctypes.data_as(ctypes.c_void_p) for each in arrays]
    squares = library.run(
        numbers.ctypes.data_as(ctypes.c_void_p), step.ctypes.data_as(ctypes.c_void_p),
        len(arrays[0]), *places[:3], len(arrays[3]), *places[3:],
        ctypes.c_double(1.0 - washed.share),
        round(plant.delay_s / TICK_S), round(law.sample_time_s / TICK_S), ticks,
        ctypes.c_double(TICK_S),
    )  # fmt: skip
    return math.sqrt(squares / ticks)


def main() -> None:
    """Run the benchmark."""
    parser = command_line(__doc__)
    chosen = parser.parse_args()
    scenario = load_config(STORM, Scenario)
    only = {"controllers": {"gpc": scenario.controllers["gpc"]}}
    scenario = scenario.model_copy(update={**only, "duration_s": SECONDS, "settle_s": 0.0})
    law = build_law(scenario.controllers["gpc"])
    assert isinstance(law.linear, WashoutLaw)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "loop.so"
        words = ["cc", "-O3", "-ffp-contract=off", "-shared", "-fPIC", SOURCE, "-o", made, "-lm"]
        subprocess.run([str(word) for word in words], check=True)
        library = ctypes.CDLL(str(made))
    library.run.restype = ctypes.c_double
    begin = time.process_time()
    in_c_rad = roll_in_c(library, scenario, law.linear)
    in_c_s = time.process_time() - begin
    rows_of("linear", scenario, scenario.seed, {"gpc": law})  # what is compiled at first use
    begin = time.process_time()
    rows = rows_of("linear", scenario, scenario.seed, {"gpc": law})
    case_s = time.process_time() - begin
    roll_rad = next(row["roll_rms_rad"] for row in rows if row["run"] == "gpc")
    show(
        {
            "compiled": in_use(),
            "case, s of processor an hour of ship": round(case_s * 3600 / SECONDS, 3),
            "C": round(in_c_s * 3600 / SECONDS, 3),
            "ratio": round(case_s / in_c_s, 2),
            "roll, degrees": round(math.degrees(float(roll_rad)), 3),
            "roll in C": round(math.degrees(in_c_rad), 3),
        },
        chosen,
    )


if __name__ == "__main__":
    main()
