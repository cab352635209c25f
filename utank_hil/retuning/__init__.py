"""Retuning while running: what of it lives in the controller's process, and the way to the rest."""

from utank_hil.retuning.adaptive import AdaptiveController, RetuningEvent
from utank_hil.retuning.answer import Answer, Candidate, ModelSummary, Refusal
from utank_hil.retuning.process import RetunerProcess
from utank_hil.retuning.pulses import make_pulses
from utank_hil.retuning.retuner import Retuner, SimulatedRetuner, Work
from utank_hil.retuning.settings import RetuningSettings

__all__ = [
    "AdaptiveController",
    "Answer",
    "Candidate",
    "ModelSummary",
    "Refusal",
    "Retuner",
    "RetunerProcess",
    "RetuningEvent",
    "RetuningSettings",
    "SimulatedRetuner",
    "Work",
    "make_pulses",
]
