"""Identification of ship and tank from recorded inputs and outputs.

No CAN, clocks or files: arrays in, models out.
"""

from utank_hil.identification.disturbance import DisturbanceBasis
from utank_hil.identification.era import (
    era,
    era_dc,
    era_with_observer,
    hankel_singular_values,
    order_from_singular_values,
)
from utank_hil.identification.errors import IdentificationError
from utank_hil.identification.excitation import (
    chirp,
    multisine,
    prbs,
    random_pulses,
    response_scale,
)
from utank_hil.identification.markov import markov_parameters
from utank_hil.identification.modal import (
    ModalConfidence,
    ModalParameters,
    modal_assurance,
    modal_confidence,
    modal_parameters,
)
from utank_hil.identification.okid import OkidResult, arx, okid
from utank_hil.identification.persistence import excitation_order
from utank_hil.identification.recursive import RecursiveArx
from utank_hil.identification.refinement import Refinement, refine
from utank_hil.identification.ship_fit import ShipFit, fit_ship
from utank_hil.identification.stabilization import StabilizationPoint, stabilization
from utank_hil.identification.validation import Validation, validate
from utank_hil.identification.wave_lines import find_disturbance_frequencies

__all__ = [
    "DisturbanceBasis",
    "IdentificationError",
    "ModalConfidence",
    "ModalParameters",
    "OkidResult",
    "RecursiveArx",
    "Refinement",
    "ShipFit",
    "StabilizationPoint",
    "Validation",
    "arx",
    "chirp",
    "era",
    "era_dc",
    "era_with_observer",
    "excitation_order",
    "find_disturbance_frequencies",
    "fit_ship",
    "hankel_singular_values",
    "markov_parameters",
    "modal_assurance",
    "modal_confidence",
    "modal_parameters",
    "multisine",
    "okid",
    "order_from_singular_values",
    "prbs",
    "random_pulses",
    "refine",
    "response_scale",
    "stabilization",
    "validate",
]
