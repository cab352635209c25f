"""What the tools share that try laws in seas: shipped laws, scenarios, measured hours, arguments.

No command of its own.
"""

import argparse
import dataclasses
import math
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import Progress

from tools.printing import command_line
from tools.studies.sea_trial import Entrant, Trial, TrialFigures, run_trials
from utank_hil.assembly import build_law
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import ConstrainedDesign, PumpLimits
from utank_hil.sea import Spectrum, load_ndbc

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
STORM_HOUR = "2019-02-10T05:40"
Case = TypeVar("Case")


def shipped(name: str) -> ControllerConfig:
    """A configuration of ``configs/controllers``."""
    return load_config(CONFIGS / "controllers" / f"{name}.yaml", ControllerConfig)


def entrant(name: str, config: ControllerConfig) -> Entrant:
    """A configured law with the limiter behind it."""
    built = build_law(config)
    if built.linear is None:
        raise ValueError(f"{name} is no linear law: only these are tried in seas here")
    return Entrant(name, built.linear, built.measured, config.limits)


def measured_hour(time: str) -> Spectrum:
    """Spectrum of an hour of NDBC 41010, February 2019."""
    return load_ndbc(CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt").at(time)


def expecting(config: ControllerConfig, sea: Spectrum) -> ControllerConfig:
    """A constrained law that expects a sea other than its own."""
    if not isinstance(config.law, ConstrainedDesign):
        raise ValueError(f"{config.name} expects no sea")
    model = dataclasses.replace(
        config.law.sea,
        frequency_hz=tuple(sea.frequency_hz.tolist()),
        density_m2_hz=tuple(sea.density.tolist()),
    )
    return config.model_copy(update={"law": dataclasses.replace(config.law, sea=model)})


def limited(config: ControllerConfig, limits: PumpLimits) -> ControllerConfig:
    """The same law within other limits."""
    return config.model_copy(update={"limits": limits})


def parser(text: str | None, *, seeds: int, first_seed: int) -> argparse.ArgumentParser:
    """Command line with the arguments that all such tools take."""
    made = command_line(text)
    made.add_argument(
        "--seeds", type=int, default=seeds, help="realisations of each sea, 2 or more (%(default)s)"
    )
    made.add_argument(
        "--first-seed", type=int, default=first_seed, help="the first of them (%(default)s)"
    )
    made.add_argument(
        "--seconds", type=float, default=3600.0, help="length of each run (%(default)s)"
    )
    return made


def parsed(made: argparse.ArgumentParser) -> argparse.Namespace:
    """The arguments, checked."""
    arguments = made.parse_args()
    if arguments.seeds < 2:
        made.error("--seeds must be 2 or more: one value has no confidence interval")
    if not (math.isfinite(arguments.seconds) and arguments.seconds >= 60):
        made.error("--seconds must be 60 or more")
    return arguments


def seeds_of(arguments: argparse.Namespace) -> range:
    """The seeds that were asked for."""
    return range(arguments.first_seed, arguments.first_seed + arguments.seeds)


def run_shown(cases: Mapping[str, Sequence[Trial]]) -> dict[str, list[dict[str, TrialFigures]]]:
    """Figures of each case's trials; a progress bar on standard error, Ctrl-C ends the program."""
    trials = [trial for case in cases.values() for trial in case]
    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task(f"{len(trials)} trials", total=1.0)
        try:
            found = iter(run_trials(trials, lambda done: bar.update(task, completed=done)))
        except KeyboardInterrupt:
            sys.exit("interrupted")
        except BrokenProcessPool:
            sys.exit("a process of the trials was ended from outside: run the command again")
    return {name: [next(found) for _ in case] for name, case in cases.items()}


def chosen(cases: Mapping[str, Case], text: str) -> dict[str, Case]:
    """The cases whose names hold a text.

    Raises `ValueError` if none does.
    """
    found = {name: case for name, case in cases.items() if text in name}
    if not found:
        raise ValueError(f"--only {text!r} is in no case's name; there are {'; '.join(cases)}")
    return found
