"""When a ship capsizes: thresholds, probability in an irregular sea, and a picture.

    python -m tools.thesis.capsize_study          # --seas, --out out, --json

The ship is Patti-B if no other is named, in a wave moment of 0.6 rad/s as in thesis section 4.5.
Thresholds are the least amplitudes up to 200 kN m that capsize her from rest within 300 s, without
a tank and with it, over what the source leaves open: the phase at which the wave starts, the duct's
height Lz and the water's damping. The probability is of capsizing within ten minutes in a JONSWAP
sea on the beam. The picture shows phase plane, safe basin and its erosion, with the tank of the
ship's file. Takes some minutes on two cores, most of them for the thresholds.
"""

import argparse
import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from tools.printing import command_line, show
from tools.thesis.capsize.maps import capsize_map, phase_grid
from tools.thesis.capsize.picture import draw_capsize_maps
from tools.thesis.capsize.sea_stack import stacked_seas
from tools.thesis.capsize.threshold import (
    Probability,
    capsize_probability,
    capsize_threshold,
    without_tank,
)
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.dynamics import RollModel
from utank_hil.sea import Sea, jonswap

PATTI_B = Path(__file__).resolve().parents[2] / "configs" / "ships" / "patti_b.yaml"
HIGHEST_NM = 2e5
PHASES = 12
LZ_M = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0)
DAMPING = (0.05, 0.1, 0.2, 0.3, 0.5)
DURATION_S = 300.0
SEA_S = 600.0
COMPONENTS = 128  # of each sea: ten minutes of 100 waves
GRID = 161  # starts in either direction
AMPLITUDES = 41  # of the erosion
SHARE = 0.8  # wave moment of the basin, of the threshold without a tank


def phases_deg(model: RollModel) -> list[float]:
    """Phases to start the wave at; of an upright ship the other half turn is to the other side."""
    heeled = model.ship.wind_moment_nm or model.ship.offset_moment_nm
    return [(360.0 if heeled else 180.0) * k / PHASES for k in range(PHASES)]


def thresholds(model: RollModel, wave_rad_s: float) -> list[dict[str, Any]]:
    """Thresholds at each phase in N m, first without a tank; infinite where none was found."""
    ships: list[tuple[dict[str, Any], RollModel]] = [
        ({"lz_m": None, "damping_ratio": None}, without_tank(model))
    ]
    for lz_m, damping in product(LZ_M, DAMPING):
        place = {"lz_m": lz_m, "damping_ratio": damping}
        ships.append((place, RollModel(model.ship, replace(model.tank, **place))))
    return [
        place
        | {
            "threshold_nm": [
                capsize_threshold(
                    ship,
                    wave_rad_s,
                    HIGHEST_NM,
                    duration_s=DURATION_S,
                    phase_rad=math.radians(phase),
                ).capsizing_nm
                for phase in phases_deg(model)
            ]
        }
        for place, ship in track(ships, "thresholds", console=Console(stderr=True))
    ]


def probability(model: RollModel, arguments: argparse.Namespace) -> Probability:
    """Probability of capsizing in the irregular sea."""
    spectrum = jonswap(arguments.hs_m, arguments.tp_s)
    seas = stacked_seas(
        Sea.irregular(spectrum, seed, components=COMPONENTS).roll_moment(
            model.ship.stiffness_nm_rad
        )
        for seed in range(1, arguments.seas + 1)
    )
    return capsize_probability(model, seas, SEA_S)


def parse() -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Read the command line; counts must be positive."""
    parser = command_line(__doc__)
    parser.add_argument("vessel", nargs="?", type=Path, default=PATTI_B)
    parser.add_argument("--wave-rad-s", type=float, default=0.6, help="%(default)s")
    parser.add_argument("--hs-m", type=float, default=5.0, help="of the sea, %(default)s")
    parser.add_argument("--tp-s", type=float, default=10.5, help="of the sea, %(default)s")
    parser.add_argument("--seas", type=int, default=1000, help="how many, %(default)s")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the picture")
    arguments = parser.parse_args()
    for key in ("wave_rad_s", "hs_m", "tp_s", "seas"):
        if not (math.isfinite(getattr(arguments, key)) and getattr(arguments, key) > 0):
            parser.error(f"--{key.replace('_', '-')} must be positive")
    return parser, arguments


def main() -> None:
    """Run the study; print the figures and draw the picture."""
    parser, arguments = parse()
    path, wave_rad_s = arguments.out / "capsize.png", arguments.wave_rad_s
    try:
        vessel = load_config(arguments.vessel, Vessel)
        model = RollModel(vessel.ship, vessel.tank)
        bare = without_tank(model)
        # all that can be refused, before minutes of work
        grid = phase_grid(bare, GRID)
        arguments.out.mkdir(parents=True, exist_ok=True)
        path.open("ab").close()
    except (ConfigError, ValueError, OSError) as error:
        parser.error(str(error))
    ships = {"Without a tank": bare, "With the tank": model}
    found = thresholds(model, wave_rad_s)
    probabilities = {name: probability(each, arguments)._asdict() for name, each in ships.items()}
    wave_nm = SHARE * min(found[0]["threshold_nm"][0], HIGHEST_NM)
    amplitude_nm = np.linspace(0.0, HIGHEST_NM, AMPLITUDES)
    drawn = [
        capsize_map(name, each, wave_rad_s, wave_nm, amplitude_nm, *grid, DURATION_S)
        for name, each in ships.items()
    ]
    draw_capsize_maps(
        drawn,
        path,
        f"{vessel.name}: safe starts in calm water, and in a wave moment of "
        f"{wave_nm / 1e3:.0f} kN m at {wave_rad_s:g} rad/s",
    )
    figures = {
        "vessel": vessel.name,
        "phases_deg": phases_deg(model),
        "thresholds": found,
        "probabilities": probabilities,
        "wave_nm": wave_nm,
        "amplitude_nm": amplitude_nm.tolist(),
        "erosion": {each.name: each.area.tolist() for each in drawn},
        "picture": str(path),
    }
    show(figures, arguments)


if __name__ == "__main__":
    main()
