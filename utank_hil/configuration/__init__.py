"""Configuration files, read and checked; nothing is designed here."""

from utank_hil.configuration.controller import ControllerConfig
from utank_hil.configuration.files import ConfigError, ConfigProblem, Section, load_config
from utank_hil.configuration.vessel import Vessel

__all__ = [
    "ConfigError",
    "ConfigProblem",
    "ControllerConfig",
    "Section",
    "Vessel",
    "load_config",
]
