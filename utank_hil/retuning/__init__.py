"""Retuning in service: identify the ship, redesign the law, and exchange it while the loop runs.

Exports what the controller's process needs. Identification and design (`redesign`) run in a process
of their own and are not imported here.
"""

from utank_hil.retuning.adaptive import AdaptiveController
from utank_hil.retuning.answer import Answer, Candidate, ModelSummary, Refusal
from utank_hil.retuning.desk import Desk
from utank_hil.retuning.estimate import MotionEstimate, ShipFigures
from utank_hil.retuning.estimator import EstimateFigures, EstimateSettings, Estimator
from utank_hil.retuning.law_exchange import LawExchange, RetuningEvent, RetuningOrder
from utank_hil.retuning.pulses import make_pulses
from utank_hil.retuning.renewed_law import RenewedLaw
from utank_hil.retuning.renewing import RenewingController
from utank_hil.retuning.retuner import RetuneFunction, Retuner, SimulatedRetuner, Work
from utank_hil.retuning.retuner_process import RetunerProcess
from utank_hil.retuning.settings import RetuningSettings

__all__ = [
    "AdaptiveController",
    "Answer",
    "Candidate",
    "Desk",
    "EstimateFigures",
    "EstimateSettings",
    "Estimator",
    "LawExchange",
    "ModelSummary",
    "MotionEstimate",
    "Refusal",
    "RenewedLaw",
    "RenewingController",
    "RetuneFunction",
    "Retuner",
    "RetunerProcess",
    "RetuningEvent",
    "RetuningOrder",
    "RetuningSettings",
    "ShipFigures",
    "SimulatedRetuner",
    "Work",
    "make_pulses",
]
