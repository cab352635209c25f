"""Identification of ship and tank from records: arrays in, models out; no CAN, clocks or files."""

from utank_hil.identification.disturbance import disturbance_basis as disturbance_basis
from utank_hil.identification.disturbance import (
    find_disturbance_frequencies as find_disturbance_frequencies,
)
from utank_hil.identification.era import era as era
from utank_hil.identification.era import modal_parameters as modal_parameters
from utank_hil.identification.excitation import chirp as chirp
from utank_hil.identification.excitation import multisine as multisine
from utank_hil.identification.excitation import prbs as prbs
from utank_hil.identification.excitation import random_pulses as random_pulses
from utank_hil.identification.excitation import response_scale as response_scale
from utank_hil.identification.okid import OkidResult as OkidResult
from utank_hil.identification.okid import arx as arx
from utank_hil.identification.okid import markov_parameters as markov_parameters
from utank_hil.identification.okid import okid as okid
from utank_hil.identification.record import IdentificationError as IdentificationError
from utank_hil.identification.ship_fit import ShipFit as ShipFit
from utank_hil.identification.ship_fit import fit_ship as fit_ship
from utank_hil.identification.validation import Validation as Validation
from utank_hil.identification.validation import validate as validate
