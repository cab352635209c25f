"""Laws on ships that are loaded otherwise than their files say, with all limits of the pump.

    python -m tools.studies.other_loads --json     # --only "OPV", --draws, --workers

Each ship has a self-tuned law and a GPC (`tuning: auto`) for its sea, and sails that sea, and one
half as high again, at 0.85 to 1.3 of the roll period of its file, by `firmware_sim.prediction`: the
bench's plant without bus and nodes. Figures are the roll over that of the passive tank.
"""

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from firmware_sim.prediction import loaded, predict
from firmware_sim.scenario import Scenario
from firmware_sim.starter import FILES, SCENARIO, StarterShip, make_starter
from tools.printing import command_line, show
from utank_hil.analysis.loop.linear_tuning import AutoDesign
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.analysis.tank_sizing import TankRoom
from utank_hil.base.background import one_thread_each
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import SeaModel
from utank_hil.sea import jonswap

CONFIGS: Final = Path("configs")
LOADS: Final = (0.85, 1.0, 1.15, 1.3)
HEIGHTS: Final = (1.0, 1.5)
FIRST_SEED: Final = 8101  #: Of draws that nothing was chosen with.

Made = tuple[Scenario, ControllerConfig]


def _offshore(displacement_t: float, hs_m: float | None, tp_s: float | None) -> Made:
    """An offshore patrol vessel as `init` makes it, with a law for its sea."""
    ship = StarterShip("OPV", 90.0, 14.0, displacement_t, 1.1, 10.5, 4.0)
    project = make_starter(ship, TankRoom.in_hull(90.0, 14.0), hs_m=hs_m, tp_s=tp_s)
    with tempfile.TemporaryDirectory() as folder:
        for file in FILES:
            (Path(folder) / file).write_text(project.texts[file])
        scenario = load_config(Path(folder) / SCENARIO, Scenario)
    waves = jonswap(project.sea["hs_m"], project.sea["tp_s"])
    bands = tuple(waves.frequency_hz.tolist()), tuple(waves.density.tolist())
    sea = SeaModel(*bands, effective_slope=project.sea["effective_slope"]["coefficient"])
    law = SelfTunedDesign("self_tuned", sea)
    config = scenario.controllers["self_tuned"]
    return scenario, config.model_copy(update={"law": law, "sea_estimate": None})


def _shipped(scenario: str, of_sea: str) -> Made:
    """A shipped scenario, with a self-tuned law for the sea of the controller `of_sea`."""
    found = load_config(CONFIGS / "scenarios" / f"{scenario}.yaml", Scenario)
    config = load_config(CONFIGS / "controllers" / f"{of_sea}.yaml", ControllerConfig)
    law = SelfTunedDesign("self_tuned", getattr(config.law, "sea", None))
    return found, config.model_copy(update={"law": law})


SHIPS: Final[dict[str, Callable[[], Made]]] = {
    "OPV, 2000 t, 2 m 10.5 s": lambda: _offshore(2000.0, None, None),
    "OPV, 2000 t, 4 m 9 s": lambda: _offshore(2000.0, 4.0, 9.0),
    "OPV, 2600 t, 2 m 10.5 s": lambda: _offshore(2600.0, None, None),
    "first ship, storm": lambda: _shipped("storm", "self_tuned"),
    "first ship, storm not known": lambda: _shipped("storm", "self_tuning"),
    "naval vessel": lambda: _shipped("naval_vessel", "naval_constrained_gpc"),
    "Patti-B": lambda: _shipped("patti_b", "patti_b_constrained_gpc"),
}


def _higher(scenario: Scenario, factor: float) -> Scenario:
    slope = scenario.sea.effective_slope
    steeper = type(slope)(coefficient=slope.coefficient * factor)
    return scenario.model_copy(
        update={"sea": scenario.sea.model_copy(update={"effective_slope": steeper})}
    )


def sailed(name: str, draws: int, heights: Sequence[float]) -> list[dict[str, Any]]:
    """Rows of one ship: heights and loads."""
    scenario, config = SHIPS[name]()
    plant, seeds = config.design_plant, tuple(range(FIRST_SEED, FIRST_SEED + draws))
    sea = getattr(config.law, "sea", None)
    laws = {
        "self-tuned": config.law.build(plant),
        "GPC": AutoDesign("gpc", "auto", sea).build(plant),
    }
    rows = []
    for height in heights:
        for load in LOADS:
            case = loaded(_higher(scenario, height), load)
            row: dict[str, Any] = {"ship": name, "height": height, "roll period": load}
            for law, built in laws.items():
                (found,) = predict(case, config.plant, built, seeds=seeds)
                passive, active = found.passive_rad, found.active_rad
                row["passive, degrees"] = math.nan if passive is None else math.degrees(passive[0])
                row[law] = math.nan if active is None else math.degrees(active[0])
                gain = found.active_below_passive
                row[f"{law} / passive"] = math.nan if gain is None else 1 - gain.mean
                power = found.mean_power_w
                row[f"{law}, kW"] = math.nan if power is None else power.mean / 1e3
            print(*row.values(), sep=", ", file=sys.stderr, flush=True)
            rows.append(row)
    return rows


def main(words: Sequence[str] | None = None) -> None:
    """Print a table of all ships, heights and loads."""
    parser = command_line(__doc__)
    parser.add_argument("--only", default="", help="ships whose names hold this text")
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--heights", type=float, nargs="+", default=HEIGHTS, help="over the sea's")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args(words)
    names = [name for name in SHIPS if arguments.only in name]
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(arguments.workers, mp_context=spawn) as pool:
        started = [pool.submit(sailed, name, arguments.draws, arguments.heights) for name in names]
        rows = [row for ship in started for row in ship.result()]
    show(rows, arguments)


if __name__ == "__main__":
    main()
