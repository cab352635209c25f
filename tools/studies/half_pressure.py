"""All, half or none of the pressure while a fault lasts that does not end control by itself.

    python -m tools.studies.half_pressure --json     # --seeds, --seconds

Rows of the fault campaign whose fault is an alarm, or halves the pressure, at first or for good; in
the waves of several seeds, with each share of the greatest pressure from the fault on. All is an
alarm alone, none is a ramp at once. Figures are the roll after the fault, root mean square over the
seeds, in parts of that of a ship that is disarmed then, the greatest roll in degrees, and how many
seeds ended in FAULT.
"""

import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.fault_campaign.campaign import Campaign, Row
from firmware_sim.fault_campaign.trial import in_a_copy
from firmware_sim.faulty_bench import FaultyBench
from tools.printing import command_line, show
from utank_hil.assembly import build_law
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Mode
from utank_hil.configuration import load_config
from utank_hil.control import BuiltLaw
from utank_hil.nodes.panel import Action, TimedAction

CAMPAIGN: Final = Path("configs/faults/campaign.yaml")
SHARES: Final = {"all": 1.0, "half": 0.5, "none": 0.0}
FIRST_SEED: Final = 500
ROWS: Final = (
    "pump-sensor-silent", "tank-silent", "patti-tank-silent", "roll-drift-fast", "roll-drift-slow",
    "level-offset", "naval-level-offset", "noise-10-fold", "level-noise", "motion-silent-of-two",
    "motion-2-silent", "saturated", "drive-status-2-silent",
)  # fmt: skip
SECOND_NS: Final = 1_000_000_000
Rolls = tuple[list[float], bool]


def underway(campaign: Campaign, setup_name: str, law: BuiltLaw, seed: int) -> FaultyBench:
    """A ship under way up to the moment of the fault."""
    setup, at_s = campaign.setups[setup_name], campaign.fault_at_s(seed)
    arm = (TimedAction(campaign.arm_s, Action.ARM),)
    bench = FaultyBench(setup.scenario_of(at_s), setup.config, law, seed=seed, script=arm)
    bench.run(round(at_s * SECOND_NS))
    return bench


def rolls_after(bench: FaultyBench, row: Row | None, share: float, seconds: float) -> Rolls:
    """Roll in each tick after the fault, and whether the controller ended in FAULT.

    Without a row the operator disarms instead, so that the pump is at zero pressure.
    """
    safety = bench.node.safety
    if row is None:
        bench.ship.panel.press(Action.DISARM)
    else:
        # as of a motion sensor without protection, so whatever the table asks for
        safety._degraded_share, safety._unprotected = 2.0 * share * safety._degraded_share, True
        bench.place(row.fault.inject)
    start_ns = bench.lockstep.now_ns
    rolls = []
    for time_ns in range(start_ns, start_ns + round(seconds * SECOND_NS), TICK_NS):
        bench.run(time_ns + TICK_NS)
        rolls.append(bench.ship.plant.roll_rad)
    return rolls, bench.node.mode is Mode.FAULT


def compare(seeds: Sequence[int], seconds: float) -> dict[str, Any]:
    """Figures of each of the rows."""
    campaign = load_config(CAMPAIGN, Campaign)
    rows = [row for row in campaign.rows if row.id in ROWS]
    laws: dict[str, BuiltLaw] = {}
    found: dict[str, dict[str, list[Rolls]]] = {row.id: {} for row in rows}
    for setup in dict.fromkeys(row.fault.setup for row in rows):
        laws[setup] = build_law(campaign.setups[setup].config)
        for seed in seeds:
            bench = underway(campaign, setup, laws[setup], seed)
            calm = in_a_copy(partial(rolls_after, bench, None, 0.0, seconds))
            for row in (each for each in rows if each.fault.setup == setup):
                own = found[row.id]
                own.setdefault("calm", []).append(calm)
                for name, share in SHARES.items():
                    made = in_a_copy(partial(rolls_after, bench, row, share, seconds))
                    own.setdefault(name, []).append(made)
            print(f"{setup}, seed {seed}", file=sys.stderr)
    return {name: _figures(each) for name, each in found.items()}


def _figures(runs: dict[str, list[Rolls]]) -> dict[str, Any]:
    def rms(name: str) -> float:
        return float(np.sqrt(np.mean([np.square(rolls).mean() for rolls, _ in runs[name]])))

    figures: dict[str, Any] = {}
    for name in SHARES:
        figures[name] = round(rms(name) / rms("calm"), 3)
    for name in SHARES:
        most_rad = max(max(map(abs, rolls)) for rolls, _ in runs[name])
        figures[f"{name}, greatest, degrees"] = round(math.degrees(most_rad), 2)
    for name in SHARES:
        figures[f"{name}, ended"] = sum(ended for _, ended in runs[name])
    return figures


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the comparison."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=120.0)
    chosen = parser.parse_args(arguments)
    seeds = range(FIRST_SEED, FIRST_SEED + chosen.seeds)
    show(compare(seeds, chosen.seconds), chosen)


if __name__ == "__main__":
    main()
