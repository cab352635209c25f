"""Retuning in service: identify the ship, redesign the law, and exchange it while the loop runs.

Exports what the controller's process needs. Identification and design (`redesign`) run in a process
of their own and are not imported here.
"""

from utank_hil.retuning.adaptive import AdaptiveController, RetuningEvent, RetuningOrder
from utank_hil.retuning.answer import Answer, Candidate, ModelSummary, Refusal
from utank_hil.retuning.pulses import make_pulses
from utank_hil.retuning.retuner import RetuneFunction, Retuner, SimulatedRetuner
from utank_hil.retuning.retuner_process import RetunerProcess
from utank_hil.retuning.settings import RetuningSettings

__all__ = [
    "AdaptiveController",
    "Answer",
    "Candidate",
    "ModelSummary",
    "Refusal",
    "RetuneFunction",
    "Retuner",
    "RetunerProcess",
    "RetuningEvent",
    "RetuningOrder",
    "RetuningSettings",
    "SimulatedRetuner",
    "make_pulses",
]
