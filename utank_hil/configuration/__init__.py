"""Configuration files, read and checked; nothing is designed here."""

from utank_hil.configuration.controller import ControllerConfig as ControllerConfig
from utank_hil.configuration.files import ConfigError as ConfigError
from utank_hil.configuration.files import ConfigProblem as ConfigProblem
from utank_hil.configuration.files import Section as Section
from utank_hil.configuration.files import load_config as load_config
from utank_hil.configuration.vessel import Vessel as Vessel
