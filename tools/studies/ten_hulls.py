"""Ten ships of `init --hull`, 24 to 330 m: an hour each, with sway and without.

    python -m tools.studies.ten_hulls --json     # --seconds, --only "330", --workers

Each ship has the tank, pump, self-tuned law and beam sea that `init` gives it. Without sway it
rolls alone, in waves of the effective slope of its hull data. It must be in charge throughout.
"""

import math
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.bench import jobs_of
from firmware_sim.hull.compute import Loading, usual_hull, write_hull
from firmware_sim.run import RECORD_NS, RECORD_S, roll_without_tank, run_lockstep
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from firmware_sim.starter import FILES, HULL, SCENARIO, StarterShip, make_starter
from tools.printing import command_line, show
from utank_hil.analysis.tank_sizing import TankRoom
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.canbus.enumerations import Mode
from utank_hil.configuration import load_config

SHIPS: Final = {
    # length, beam, draught, displacement, GM, roll period
    "trawler, 24 m": (24, 7.5, 3.0, 300, 0.7, None),
    "yacht, 45 m": (45, 9.0, 2.8, 520, 0.9, None),
    "patrol vessel, 63 m": (63, 9.5, 3.9, 1350, 0.9, 8.0),
    "supply vessel, 80 m": (80, 18.0, 6.0, 6000, 1.8, None),
    "coaster, 85 m": (85, 13.0, 5.5, 4400, 0.9, None),
    "frigate, 120 m": (120, 15.0, 4.6, 4200, 1.0, None),
    "ferry, 180 m": (180, 28.0, 6.5, 20000, 1.8, None),
    "bulk carrier, 200 m": (200, 32.2, 11.5, 61000, 2.5, None),
    "cruise liner, 290 m": (290, 36.0, 8.3, 62000, 2.0, None),
    "container ship, 330 m": (330, 45.0, 14.5, 145000, 1.5, None),
}
SETTLE_S: Final = 120.0
SEED: Final = 5  #: Not one that the laws were designed with.


def starter(name: str, folder: Path) -> tuple[Scenario, dict[str, Any]]:
    """The scenario of a ship, as `init --hull` writes it, and its hull in figures."""
    length, beam, draught, displacement, gm, period = SHIPS[name]
    ship = StarterShip(name, length, beam, displacement, gm, period, draught)
    loading = Loading(gm, roll_period_s=ship.period_s, displacement_t=displacement)
    data, hull = usual_hull(ship.form, loading)
    ship = replace(ship, radiated_ratio=hull.radiation_ratio)
    project = make_starter(
        ship, TankRoom.in_hull(length, beam), effective_slope=hull.effective_slope
    )
    for file in FILES:
        (folder / file).write_text(project.texts[file])
    write_hull(folder / HULL, data)
    return load_config(folder / SCENARIO, Scenario), {
        "roll_period_s": ship.period_s,
        "damping_ratio": ship.damping[0],
        "radiation_ratio": hull.radiation_ratio,
        "effective_slope": hull.effective_slope,
        "memory_error": hull.radiation.error,
    }


def passive_roll(scenario: Scenario, count: int) -> FloatArray:
    """Roll with the pump at rest, every `RECORD_S`, shape (count,)."""
    plant = build_ship_side(scenario, SEED, ()).plant
    rolls = np.empty(count)
    for row in range(count):
        plant.advance(row * RECORD_NS)
        rolls[row] = plant.roll_rad
    return rolls


def sailed(case: tuple[str, float]) -> tuple[str, dict[str, Any]]:
    """One ship: its rolls without tank, passive and active, with sway and without."""
    name, seconds = case
    with tempfile.TemporaryDirectory() as folder:
        swaying, found = starter(name, Path(folder))
        sea = swaying.sea.model_copy(
            update={"effective_slope": type(swaying.sea.effective_slope)(
                coefficient=found["effective_slope"])}
        )  # fmt: skip
        alone = swaying.model_copy(update={"plant": "roll", "hull": None, "sea": sea})
        for kind, scenario in (("sway", swaying), ("roll", alone)):
            scenario = scenario.model_copy(update={"duration_s": seconds})
            bare, _ = roll_without_tank(scenario, SEED, round(seconds / RECORD_S))
            begin = round(SETTLE_S / RECORD_S)
            rolls = {"no_tank": bare[begin:], "passive": passive_roll(scenario, len(bare))[begin:]}
            run = run_lockstep(jobs_of(scenario, SEED, seconds)[1])
            inside = run.between(SETTLE_S, seconds)
            rolls["active"] = run.column("true_roll_rad")[inside]
            rms = {each: math.degrees(np.sqrt(np.mean(roll**2))) for each, roll in rolls.items()}
            found[kind] = {
                **{f"{each}_deg": value for each, value in rms.items()},
                "passive_below_no_tank": 1 - rms["passive"] / rms["no_tank"],
                "active_below_passive": 1 - rms["active"] / rms["passive"],
                "in_charge": float(np.mean(run.column("mode")[inside] == Mode.ACTIVE)),
            }
    return name, found


def main() -> None:
    """Sail and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="each run (%(default)s)")
    parser.add_argument("--only", default="", help="sail the ships whose names hold this text")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    arguments = parser.parse_args()
    cases = [(name, arguments.seconds) for name in SHIPS if arguments.only in name]
    if not cases:
        parser.error(f"--only {arguments.only!r}: no ship's name; there are {'; '.join(SHIPS)}")
    found: dict[str, Any] = {}
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(arguments.workers, mp_context=spawn) as pool:
        for name, ship in pool.map(sailed, cases):
            found[name] = ship
            sys.stderr.write(f"{name}: {ship}\n")
    show({"seconds": arguments.seconds, **found}, arguments)


if __name__ == "__main__":
    main()
