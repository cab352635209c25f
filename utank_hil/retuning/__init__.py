"""Retuning in service: identify the ship, redesign the law, and exchange it while the loop runs.

Exports what the controller's process needs. Identification and design (`redesign`) run in a process
of their own and are not imported here.
"""

from utank_hil.canbus.events import ModelSummary as ModelSummary
from utank_hil.canbus.events import RetuningEvent as RetuningEvent
from utank_hil.retuning.adaptive import AdaptiveController as AdaptiveController
from utank_hil.retuning.adaptive import Pulses as Pulses
from utank_hil.retuning.adaptive import make_pulses as make_pulses
from utank_hil.retuning.answer import Answer as Answer
from utank_hil.retuning.answer import Candidate as Candidate
from utank_hil.retuning.answer import Refusal as Refusal
from utank_hil.retuning.answer import RenewedLaw as RenewedLaw
from utank_hil.retuning.estimate import MotionEstimate as MotionEstimate
from utank_hil.retuning.estimate import ShipFigures as ShipFigures
from utank_hil.retuning.estimator import EstimateFigures as EstimateFigures
from utank_hil.retuning.estimator import EstimateSettings as EstimateSettings
from utank_hil.retuning.estimator import Estimator as Estimator
from utank_hil.retuning.law_exchange import LawExchange as LawExchange
from utank_hil.retuning.renewing import RenewingController as RenewingController
from utank_hil.retuning.retuner import Desk as Desk
from utank_hil.retuning.retuner import RetuneFunction as RetuneFunction
from utank_hil.retuning.retuner import Retuner as Retuner
from utank_hil.retuning.retuner import RetunerProcess as RetunerProcess
from utank_hil.retuning.retuner import SimulatedRetuner as SimulatedRetuner
from utank_hil.retuning.retuner import Work as Work
from utank_hil.retuning.settings import RetuningSettings as RetuningSettings
