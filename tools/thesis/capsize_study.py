"""When a ship capsizes: thresholds, probability in an irregular sea, and a picture.

    python -m tools.thesis.capsize_study          # --phases, --seas, --out out, --json

The ship is Patti-B unless told, in a wave moment of 0.6 rad/s as in thesis section 4.5. Thresholds
are the least amplitudes that capsize her from rest within 300 s, without a tank and with it, over
what the source leaves open: the phase at which the wave starts, the duct's height Lz and the
water's damping. The probability is of capsizing within ten minutes in a JONSWAP sea on the beam.
The picture shows phase plane, safe basin and its erosion, with the tank of the ship's file. Takes
some minutes on two cores, most of them for the thresholds.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress, TaskID

from tools.printing import command_line, show
from utank_hil.analysis import (
    CapsizeMap,
    Probability,
    capsize_map,
    capsize_probability,
    capsize_threshold,
    phase_grid,
    stacked_seas,
    without_tank,
)
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.dynamics import RollModel, Tank
from utank_hil.pictures import draw_capsize_maps
from utank_hil.sea import Sea, jonswap

PATTI_B = Path(__file__).resolve().parents[2] / "configs" / "ships" / "patti_b.yaml"
LZ_M = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0)
DAMPING = (0.05, 0.1, 0.2, 0.3, 0.5)
DURATION_S = 300.0
SEA_S = 600.0
COMPONENTS = 128  # of each sea: ten minutes of 100 waves
GRID = 161  # starts in either direction
AMPLITUDES = 41  # of the erosion
SHARE = 0.8  # wave moment of the basin, of the threshold without a tank


class Case(NamedTuple):
    """Thresholds of the ship without a tank, or with one tank that the source may have meant.

    Attributes
    ----------
    lz_m, damping_ratio : float or None
        None without a tank.
    threshold_nm : list of float or None
        At each phase; None where no amplitude tried capsizes her.
    """

    lz_m: float | None
    damping_ratio: float | None
    threshold_nm: list[float | None]


def phases_deg(model: RollModel, count: int) -> list[float]:
    """Phases to start the wave at; of an upright ship the other half turn is to the other side."""
    heeled = model.ship.wind_moment_nm or model.ship.offset_moment_nm
    return [(360.0 if heeled else 180.0) * k / count for k in range(count)]


def all_tanks(tank: Tank, arguments: argparse.Namespace) -> list[Tank]:
    """The tank with every height and damping."""
    return [
        replace(tank, lz_m=lz, damping_ratio=damping)
        for lz in arguments.lz_m
        for damping in arguments.damping
    ]


def all_cases(
    model: RollModel, tanks: list[Tank], arguments: argparse.Namespace, bar: Progress
) -> list[Case]:
    """Thresholds without a tank, then with each."""
    ships = [(Case(None, None, []), without_tank(model))]
    ships += [
        (Case(tank.lz_m, tank.damping_ratio, []), RollModel(model.ship, tank)) for tank in tanks
    ]
    phases = phases_deg(model, arguments.phases)
    task = bar.add_task("thresholds", total=len(ships) * len(phases))
    for case, ship in ships:
        for phase in phases:
            found = capsize_threshold(
                ship,
                arguments.wave_rad_s,
                arguments.highest_nm,
                duration_s=DURATION_S,
                phase_rad=math.radians(phase),
            ).capsizing_nm
            case.threshold_nm.append(found if math.isfinite(found) else None)
            bar.advance(task)
    return [case for case, _ in ships]


def part(bar: Progress, task: TaskID, first: int) -> Callable[[float], None]:
    """What takes the progress of one ship of several."""
    return lambda done: bar.update(task, completed=first + done)


def probabilities(
    model: RollModel, arguments: argparse.Namespace, bar: Progress
) -> dict[str, Probability]:
    """Probability of capsizing in the irregular sea, without a tank and with it."""
    spectrum = jonswap(arguments.hs_m, arguments.tp_s)
    seas = stacked_seas(
        Sea.irregular(spectrum, seed, components=COMPONENTS).roll_moment(
            model.ship.stiffness_nm_rad
        )
        for seed in range(1, arguments.seas + 1)
    )
    task = bar.add_task("irregular seas", total=2.0)
    found = {}
    for n, (name, each) in enumerate({"no tank": without_tank(model), "tank": model}.items()):
        found[name] = capsize_probability(each, seas, SEA_S, progress=part(bar, task, n))
    return found


def maps(
    model: RollModel, arguments: argparse.Namespace, wave_nm: float, bar: Progress
) -> list[CapsizeMap]:
    """What is drawn, without a tank and with it, on one grid of starts."""
    bare = without_tank(model)
    grid = phase_grid(bare, GRID)
    amplitude = np.linspace(0.0, arguments.highest_nm, AMPLITUDES)
    task = bar.add_task("basins", total=2.0)
    return [
        capsize_map(
            name,
            each,
            arguments.wave_rad_s,
            wave_nm,
            amplitude,
            *grid,
            DURATION_S,
            progress=part(bar, task, n),
        )
        for n, (name, each) in enumerate((("Without a tank", bare), ("With the tank", model)))
    ]


def parse() -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Read the command line; counts must be positive."""
    parser = command_line(__doc__)
    parser.add_argument("vessel", nargs="?", type=Path, default=PATTI_B)
    parser.add_argument("--wave-rad-s", type=float, default=0.6, help="%(default)s")
    parser.add_argument(
        "--highest-nm", type=float, default=2e5, help="greatest wave moment tried, %(default)s"
    )
    parser.add_argument("--phases", type=int, default=12, help="of the wave, %(default)s")
    parser.add_argument("--lz-m", type=float, nargs="+", default=LZ_M, help="heights of the duct")
    parser.add_argument("--damping", type=float, nargs="+", default=DAMPING, help="of the water")
    parser.add_argument("--hs-m", type=float, default=5.0, help="of the sea, %(default)s")
    parser.add_argument("--tp-s", type=float, default=10.5, help="of the sea, %(default)s")
    parser.add_argument("--seas", type=int, default=1000, help="how many, %(default)s")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the picture")
    arguments = parser.parse_args()
    for key in ("wave_rad_s", "highest_nm", "phases", "hs_m", "tp_s", "seas"):
        if not (math.isfinite(getattr(arguments, key)) and getattr(arguments, key) > 0):
            parser.error(f"--{key.replace('_', '-')} must be positive")
    return parser, arguments


def main() -> None:
    """Run the study; print the tables and draw the picture."""
    parser, arguments = parse()
    try:
        vessel = load_config(arguments.vessel, Vessel)
        model = RollModel(vessel.ship, vessel.tank)
        # all that can be refused, before minutes of work
        tanks = all_tanks(vessel.tank, arguments)
        phase_grid(without_tank(model), GRID)
        arguments.out.mkdir(parents=True, exist_ok=True)
        path = arguments.out / "capsize.png"
        path.open("ab").close()
    except (ConfigError, ValueError, OSError) as error:
        parser.error(str(error))
    with Progress(console=Console(stderr=True)) as bar:
        cases = all_cases(model, tanks, arguments, bar)
        found = probabilities(model, arguments, bar)
        wave_nm = SHARE * (cases[0].threshold_nm[0] or arguments.highest_nm)
        drawn = maps(model, arguments, wave_nm, bar)
    draw_capsize_maps(
        drawn,
        path,
        f"{vessel.name}: safe starts in calm water, and in a wave moment of "
        f"{wave_nm / 1e3:.0f} kN m at {arguments.wave_rad_s:g} rad/s",
    )
    show(
        {
            "vessel": vessel.name,
            "phases_deg": phases_deg(model, arguments.phases),
            "thresholds": [case._asdict() for case in cases],
            "probabilities": {name: each._asdict() for name, each in found.items()},
            "wave_nm": wave_nm,
            "amplitude_nm": drawn[0].amplitude_nm.tolist(),
            "erosion": {each.name: each.area.tolist() for each in drawn},
            "picture": str(path),
        },
        arguments,
    )


if __name__ == "__main__":
    main()
