"""Starter projects as a new user makes them: ``utank-hil init``, then ``utank-hil bench``.

    python -m tools.studies.starter_ships

Each ship of the table goes from its dimensions to a bench of `--duration` seconds, as the commands
would take it; those for which no tank can be are listed with the reason.
"""

import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.figures import figures
from firmware_sim.scenario import Scenario
from firmware_sim.starter import FILES, SCENARIO, make_starter
from firmware_sim.starter_ship import StarterShip
from tools.printing import command_line, show
from utank_hil.analysis.tank_sizing import TankImpossibleError, TankRoom, tank_cost
from utank_hil.configuration import load_config
from utank_hil.console.admission import admit

PATROL: Final = StarterShip("patrol vessel", 63, 9.5, 1900, 0.9, 9.5)
CONTAINER: Final = StarterShip("container ship, GM 1.2 m", 200, 32.2, 42000, 1.2, None, 11.5)
TRAWLER: Final = StarterShip("trawler", 24, 7.5, 240, 0.7, None, 3.0)
SHIPS: Final[tuple[tuple[StarterShip, float | None], ...]] = (
    (PATROL, None),
    (replace(PATROL, name="patrol vessel, 3 m"), 3.0),
    (CONTAINER, None),
    (replace(CONTAINER, name="container ship, GM 3.5 m", gm_m=3.5), None),
    (TRAWLER, None),
    (replace(PATROL, name="patrol vessel, GM 0.15 m", gm_m=0.15), None),
)
"""Ships, and the wave height where it is not the starter's own."""


def on_the_bench(ship: StarterShip, hs_m: float | None, duration_s: float) -> dict[str, Any]:
    """What init says of a ship, and what the bench measures."""
    room = TankRoom.in_hull(ship.length_m, ship.beam_m)
    try:
        project = make_starter(ship, room, hs_m=hs_m)
    except TankImpossibleError as error:
        return {"ship": ship.name, "no_tank": str(error)}
    with tempfile.TemporaryDirectory() as folder:
        for file in FILES:
            (Path(folder) / file).write_text(project.texts[file], encoding="utf-8")
        path = Path(folder) / SCENARIO
        scenario = load_config(path, Scenario)
        laws = {
            name: admit(controller, path, f"controllers.{name}")
            for name, controller in scenario.controllers.items()
        }
        options = BenchOptions(duration_s=duration_s)
        result = run_bench(scenario, options, lambda _name, _done: None, laws)
    measured = figures(result)
    bare, (passive, active) = measured.no_tank, measured.compared
    vessel, found = project.vessel, project.prediction
    cost, pump = tank_cost(vessel.ship, vessel.tank), vessel.pump
    assert pump is not None
    assert passive.roll is not None
    assert active.roll is not None
    assert active.pump is not None
    return {
        "ship": ship.name,
        "roll_period_s": 2 * math.pi / vessel.ship.natural_frequency_rad_s,
        "water_t": cost.water_t,
        "share_of_displacement": cost.share_of_displacement,
        "stability_taken": cost.stability_taken,
        "max_pressure_pa": pump.max_pressure_pa,
        "max_power_w": pump.max_power_w,
        "sea": project.sea,
        "no_tank_deg": math.degrees(bare.rms_rad),
        "passive_deg": math.degrees(passive.roll.rms_rad),
        "active_deg": math.degrees(active.roll.rms_rad),
        "below_passive": active.roll_below_passive,
        "predicted_below_passive": found.active_below_passive,
        "active_share": active.active_share,
        "level_peak_m": active.pump.level_peak_m,
        "level_limit_m": vessel.tank.level_limit_m,
    }


def main() -> None:
    """Run the benches and print the table."""
    parser = command_line(__doc__)
    parser.add_argument("--duration", type=float, default=900.0, help="seconds (%(default)s)")
    options = parser.parse_args()
    rows = [on_the_bench(ship, hs_m, options.duration) for ship, hs_m in SHIPS]
    show({"duration_s": options.duration, "ships": rows}, options)


if __name__ == "__main__":
    main()
