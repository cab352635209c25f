"""Rate of false alarms of the monitors: every shipped law in calm, ordinary and storm seas.

    python -m tools.studies.false_alarms [--hours 50] [--json]

Each law of configs/controllers sails for so many hours in each sea and, where its ship has one,
half as many on the voyage; a law that can be retuned is so every second hour, pulses included. The
unit is an hour of its own seed. Of each hour the largest statistic of each monitor over its
threshold is kept (`monitor_margins`), in .cache/false_alarms: after Ctrl-C, or with more hours, the
same command at the same commit goes on; of a changed checkout nothing is kept. A Gumbel
distribution is fitted to the hourly maxima of each law in each sea; its tail beyond 1 is the rate
of false alarms there. Over all laws and seas it is the mean. The aim is one in 1000 hours. An hour
ends a minute after control has; where another monitor ended it, its maxima are not those of an
hour, and are left out of the fit.
"""

import json
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from multiprocessing import get_context
from typing import Any

import numpy as np
from scipy.stats import gumbel_r

from firmware_sim.scenario import Scenario
from tools.evidence import ROOT, commit
from tools.printing import command_line, show
from tools.studies.monitor_margins import margins
from utank_hil.base.background import one_thread_each
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.panel import Action, TimedAction

CACHE = ROOT / ".cache" / "false_alarms"
HOUR_S = 3600.0
ORDER_RETUNING_S = 400.0
AIM_PER_HOUR = 1e-3
ENDS = {"ROLL_AMPLIFIED", "LEVEL_LIMIT"}  #: Findings of this study that end control.
ENDED_BY_ITSELF = {"roll over twin": "ROLL_AMPLIFIED"}
DIGITS = 4
SEAS = {"calm": 0.2, "ordinary": 0.5, "storm": 1.0}
"""Share of the scenario's wave slope: the storm's is what the laws were made for."""
SCENARIOS = ("storm", "patti_b", "naval_vessel", "semi_active")
VOYAGE = "voyage"
RIGHTLY_FOUND = {
    *product(("feedback_linearization", "pd"), (*SEAS, VOYAGE)),
    ("self_tuned", VOYAGE),
}
"""Laws that roll the ship more than the passive tank in a sea: none of `by_monitor`.

`self_tuned` is made for the storm's sea; in the short waves at the beginning of the voyage it rolls
it 1.3 to 1.9 times as much for the first minutes.
"""


def scenario_of(config: ControllerConfig) -> Scenario:
    """The shipped scenario of a law's ship."""
    for name in SCENARIOS:
        loaded = load_config(ROOT / f"configs/scenarios/{name}.yaml", Scenario)
        if loaded.vessel == config.vessel:
            return loaded
    raise SystemExit(f"no scenario sails the ship of {config.name}")


def hours(name: str) -> Iterator[tuple[str, Scenario]]:
    """Every sea of a law, as a scenario with this law alone."""
    config = load_config(ROOT / f"configs/controllers/{name}.yaml", ControllerConfig)
    at_sea = scenario_of(config)
    for sea, share in SEAS.items():
        slope = at_sea.sea.effective_slope
        milder = at_sea.sea.model_copy(
            update={"effective_slope": replace(slope, coefficient=share * slope.coefficient)}
        )
        yield sea, at_sea.model_copy(update={"sea": milder, "controllers": {name: config}})
    voyage = load_config(ROOT / f"configs/scenarios/{VOYAGE}.yaml", Scenario)
    if voyage.vessel == config.vessel:
        yield VOYAGE, voyage.model_copy(update={"controllers": {name: config}})


def ordered(scenario: Scenario, name: str, seed: int) -> Scenario:
    """The scenario of an hour: in every second one a law that can be retuned is."""
    if seed % 2 or scenario.controllers[name].retuning is None:
        return scenario
    order = TimedAction(ORDER_RETUNING_S, Action.RETUNE)
    return scenario.model_copy(update={"operator": (*scenario.operator, order)})


def sail(name: str, sea: str, scenario: Scenario, count: int) -> list[dict[str, Any]]:
    """The hours of one law in one sea: those that are kept, and what is missing to `count`."""
    at = commit()
    file = CACHE / at / f"{name}-{sea}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.open(
        "w" if at.endswith("+") else "a"
    ).close()  # which changes a plus stands for is unknown
    kept = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    for seed in range(len(kept) + 1, count + 1):
        run = margins(ordered(scenario, name, seed), name, seed, HOUR_S)
        with file.open("a", encoding="utf-8") as growing:
            growing.write(json.dumps(run) + "\n")
        kept.append(run)
        sys.stderr.write(f"{name}, {sea}: hour {seed} of {count}\n")
    return kept


def rate_per_hour(maxima: list[float | None]) -> float:
    """Expected hours with a statistic beyond 1 per hour, by the tail of their distribution."""
    values = np.array([value for value in maxima if value is not None and math.isfinite(value)])
    if len(values) < 5 or np.ptp(values) == 0:
        return float(np.mean(values > 1)) if len(values) else 0.0
    place, scale = gumbel_r.fit(values)
    return float(gumbel_r.sf(1.0, place, scale))


def judged(name: str, sea: str, runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Rates of one law in one sea, by monitor; hours without a statistic have None."""
    monitors = sorted({monitor for run in runs for monitor in run["largest"]})
    maxima = {
        monitor: [
            round(run["largest"][monitor], DIGITS) if monitor in run["largest"] else None
            for run in runs
        ]
        for monitor in monitors
    }
    ended = [ENDS.intersection(run["found_s"]) for run in runs]
    rates = {
        monitor: rate_per_hour(
            [
                value
                for value, by in zip(values, ended, strict=True)
                if not by - {ENDED_BY_ITSELF.get(monitor)}
            ]
        )
        for monitor, values in maxima.items()
    }
    found: dict[str, list[int]] = {}
    for hour, run in enumerate(runs, 1):
        for finding in run["found_s"]:
            found.setdefault(finding, []).append(hour)
    return {
        "law": name,
        "sea": sea,
        "hours": len(runs),
        "found_in_hours": found,
        "maxima": maxima,
        "rate_per_hour": rates,
        "worst": max(rates, key=rates.__getitem__) if rates else "",
    }


def by_monitor(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Largest statistic and mean rate of each monitor over the laws that are sound, in all seas."""
    sound = [row for row in rows if (row["law"], row["sea"]) not in RIGHTLY_FOUND]
    found: dict[str, dict[str, float]] = {}
    for monitor in sorted({name for row in sound for name in row["maxima"]}):
        its = [row for row in sound if monitor in row["maxima"]]
        known = [each for row in its for each in row["maxima"][monitor] if each is not None]
        found[monitor] = {
            "hours": len(known),
            "largest": max(known),
            "rate_per_hour": float(np.mean([row["rate_per_hour"][monitor] for row in its])),
        }
    return found


def rated(case: tuple[str, str, Scenario, int]) -> dict[str, Any]:
    """`judged` of one law in one sea; in a process of its own."""
    name, sea, scenario, count = case
    return judged(name, sea, sail(name, sea, scenario, count))


def main() -> int:
    """Sail what is missing, and print the rates."""
    parser = command_line(__doc__)
    parser.add_argument(
        "--hours", type=int, default=50, help="of each law in each sea at least; on the voyage half"
    )
    parser.add_argument("--law", action="append", help="only this one; may be given again")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    options = parser.parse_args()
    laws = sorted(file.stem for file in (ROOT / "configs/controllers").glob("*.yaml"))
    cases = [
        (name, sea, scenario, -(-options.hours // 2) if sea == VOYAGE else options.hours)
        for name in options.law or laws
        for sea, scenario in hours(name)
    ]
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(options.workers, mp_context=spawn) as pool:
        rows = list(pool.map(rated, cases))
    show({"aim_per_hour": AIM_PER_HOUR, "by_monitor": by_monitor(rows), "runs": rows}, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
