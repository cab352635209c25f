"""The shipped designs, from the files that hold them."""

from pathlib import Path

from utank_hil.configuration import ControllerConfig, load_config

_CONTROLLERS = Path(__file__).parents[1] / "configs" / "controllers"


def _design(name):
    return load_config(_CONTROLLERS / f"{name}.yaml", ControllerConfig).law


GPC_ROLL = _design("gpc")
DPC_ROLL_LEVEL = _design("dpc")
LQG_ROLL_RATE_LEVEL = _design("lqg")
