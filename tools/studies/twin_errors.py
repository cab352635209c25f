"""How far the passive twin is from the passive ship, where a law came nearest to ROLL_AMPLIFIED.

    python -m tools.studies.twin_errors [--json]

Of each law in each sea whose statistic "roll over twin" came to 0.75 of its threshold or more in
docs/evidence/false_alarms.json, the hour with the largest is sailed again, and so is every hour in
which a sound law ended in ROLL_AMPLIFIED; beside it the ship without a controller in the same
waves. Own roll over the twin's is then compared with own roll over the passive ship's, with the
monitor's memories of six and twelve roll periods. An alarm is false where the law rolls the ship no
more than she would roll without it, over twelve roll periods.
"""

import json
import math
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from scipy.signal import lfilter

from firmware_sim.run import SECOND_NS
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import ShipSide, build_ship_side
from tools.printing import command_line, show
from tools.studies.false_alarms import (
    ENDED_BY_ITSELF,
    HOUR_S,
    RECORD,
    RIGHTLY_FOUND,
    hours,
    ordered,
)
from tools.studies.monitor_margins import LOOK_TICKS, controller_of
from utank_hil.base.arrays import FloatArray
from utank_hil.base.one_thread import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import Frame
from utank_hil.nodes.controller import ControllerNode
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.safety.passive_twin import MEMORY_PERIODS, RECORD_PERIODS

STATISTIC = "roll over twin"
FINDING = ENDED_BY_ITSELF[STATISTIC]
NEAR = 0.75
STEP_S = LOOK_TICKS * TICK_S


class Looker:
    """Keeps the ship's true roll, and what the monitor thinks of it."""

    name = "looker"
    period_ns = round(STEP_S * 1e9)

    def __init__(self, ship: ShipSide, node: ControllerNode | None) -> None:
        self._ship, self._node = ship, node
        self.rows: list[tuple[float, float, float, bool]] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Nothing on the bus is of interest."""

    def tick(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002
        """Look once."""
        share = ratio = math.nan
        alarm = False
        if self._node is not None and self._node.monitors is not None:
            twin = self._node.monitors.twin
            share, alarm = twin.share, twin.amplified
            ratio = twin.ship_rms_rad / twin.rms_rad if twin.rms_rad else math.nan
        self.rows.append((self._ship.plant.roll_rad, share, ratio, alarm))
        return ()


def sailed(scenario: Scenario, name: str | None, seed: int) -> FloatArray:
    """True roll, share, ratio, alarm in an hour, shape (n, 4); without a law, of the ship alone."""
    node = None if name is None else controller_of(scenario, name)
    ship = build_ship_side(scenario, seed, () if name is None else scenario.operator)
    looker = Looker(ship, node)
    bus = SimulatedBus(bit_rate=next(iter(scenario.controllers.values())).bit_rate)
    nodes = [*ship.nodes, looker] if node is None else [*ship.nodes, node, looker]
    Lockstep(nodes, bus).run_until(round(HOUR_S * SECOND_NS))
    return np.array(looker.rows)


def rms(roll_rad: FloatArray, memory_s: float, mean_s: float) -> FloatArray:
    """Running root mean square about the running mean."""
    keep, share = 1 - STEP_S / memory_s, STEP_S / mean_s
    mean = lfilter([share], [1, share - 1], roll_rad)
    power = lfilter([1 - keep], [1, -keep], (roll_rad - mean) ** 2)
    return np.asarray(np.sqrt(power), dtype=np.float64)


def compared(case: tuple[str, str, int]) -> dict[str, Any]:
    """The twin beside the passive ship in one hour."""
    name, sea, hour = case
    scenario = ordered(dict(hours(name))[sea], name, hour)
    period_s = 2 * math.pi / scenario.vessel.tank.natural_frequency_rad_s
    active, passive = sailed(scenario, name, hour), sailed(scenario, None, hour)
    with np.errstate(invalid="ignore"):  # nothing has rolled yet
        lately, long = (
            rms(active[:, 0], periods * period_s, MEMORY_PERIODS * period_s)
            / rms(passive[:, 0], periods * period_s, MEMORY_PERIODS * period_s)
            for periods in (MEMORY_PERIODS, RECORD_PERIODS)
        )
    share, twins = active[:, 1], active[:, 2]
    judged = np.isfinite(share)
    error = twins[judged] / lately[judged]
    nearest = int(np.nanargmax(share))
    harmless = judged & (long <= 1.0)
    sys.stderr.write(f"{name}, {sea}: hour {hour}\n")
    return {
        "law": name,
        "sea": sea,
        "hour": hour,
        "alarm": bool(active[:, 3].any()),
        "share": float(share[nearest]),
        "at_s": nearest * STEP_S,
        "ratio_of_twin": float(twins[nearest]),
        "ratio_of_passive_ship": float(lately[nearest]),
        "over_twelve_periods": float(long[nearest]),
        "twin_over_passive_ship": {
            "least": float(error.min()),
            "median": float(np.median(error)),
            "largest": float(error.max()),
        },
        "largest_share_while_she_rolls_less": float(share[harmless].max(initial=0.0)),
    }


def cases(row: dict[str, Any]) -> list[tuple[str, str, int]]:
    """Hours of one law in one sea that are to be compared."""
    # an hour in which it was never known has None, which becomes NaN
    maxima = np.array(row["maxima"].get(STATISTIC, [0.0]), dtype=float)
    law, sea = row["law"], row["sea"]
    alarms = [] if (law, sea) in RIGHTLY_FOUND else row["found_in_hours"].get(FINDING, [])
    nearest = [int(np.nanargmax(maxima)) + 1] if np.nanmax(maxima) >= NEAR else []
    return [(law, sea, hour) for hour in sorted({*nearest, *alarms})]


def main() -> int:
    """Compare, and print."""
    parser = command_line(__doc__)
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    options = parser.parse_args()
    rows = json.loads(RECORD.read_text(encoding="utf-8"))["result"]["runs"]
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(options.workers, mp_context=spawn) as pool:
        runs = list(pool.map(compared, (case for row in rows for case in cases(row))))
    sound = [run for run in runs if (run["law"], run["sea"]) not in RIGHTLY_FOUND]
    alarms = [run["over_twelve_periods"] for run in sound if run["alarm"]]
    show(
        {
            "hours": len(runs),
            "alarms of sound laws": {
                "hours": len(alarms),
                "false": sum(ratio <= 1 for ratio in alarms),
                "over_twelve_periods_at_least": min(alarms, default=math.nan),
            },
            "largest_share_while_she_rolls_less": {
                "all": max(run["largest_share_while_she_rolls_less"] for run in runs),
                "sound laws": max(run["largest_share_while_she_rolls_less"] for run in sound),
            },
            "runs": runs,
        },
        options,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
