"""``python -m firmware_sim.guard CONTROLLER.yaml``: print the guard's table as a C header."""

from pathlib import Path
from typing import Annotated

import typer

from firmware_sim.guard.parameters import guard_parameters
from utank_hil.configuration import ControllerConfig
from utank_hil.console.common import failing, failures_named, load


def main(config: Annotated[Path, typer.Argument(help="Controller.")]) -> None:
    """Print guard_parameters.h, the guard's table for a controller and its ship.

    Example: python -m firmware_sim.guard configs/controllers/gpc.yaml > guard_parameters.h
    """
    with failing(ValueError, at=config):
        print(guard_parameters(load(config, ControllerConfig, allow_code=True)).header, end="")


if __name__ == "__main__":
    with failures_named():
        typer.run(main)
