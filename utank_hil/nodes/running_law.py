"""The law of a controller while it runs: when it answers, to what, and what becomes of it."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS, TICK_S, Schedule
from utank_hil.canbus import RetuningOrder, RetuningState
from utank_hil.canbus.enumerations import Mode
from utank_hil.canbus.events import ModelSummary, RetuningEvent
from utank_hil.canbus.measurements import Measurements, MotionSample
from utank_hil.control.interface import (
    PRESSURE,
    VALVE,
    Controller,
    EndsByItself,
    Foresees,
    Plans,
    StartsAnew,
)
from utank_hil.control.level_observer import LevelObserver
from utank_hil.nodes.actuators import Actuators
from utank_hil.nodes.forecast_heard import forecast_of
from utank_hil.retuning.estimate import ShipFigures
from utank_hil.retuning.law_exchange import LawExchange
from utank_hil.safety.monitors.thresholds import MonitorThresholds
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import Demand, Judgement

FRESH_MS: Final = 50.0
"""An older measurement is a gap in the record that the ship is identified from."""
WATCHED_PERIODS: Final = 4.0
"""Tank periods of measurements after which a plan may use the full pressure. A law knows no waves
at first: armed after one period, it took the water to the high-level switches in 4 of 50 storms.
Armed 5 s after a gap of 30 s it did so in 25 of 32, and with two periods in 3 of 12: a gap is a
new start, and in waves that are as high as ever."""

_ACTIVE: Final = Mode.ACTIVE
_CONTROL: Final = Demand.CONTROL

Measure = Callable[[Measurements, MotionSample, LevelObserver], FloatArray]
"""Picks a law's measurement vector, shape (m,)."""
TakeOrder = Callable[[int], RetuningOrder]
"""Takes what was ordered of the retuning since the last call."""


def is_fresh(measured: Measurements, motion: MotionSample) -> bool:
    """Whether the law's measurement is no older than a gap in its record may be."""
    return max(motion.age_ms, measured.tank_age_ms) <= FRESH_MS


class RunningLaw:
    """A law on the bus; it is stepped every sample time, in charge or not.

    A law may be anybody's: whatever it raises cuts the pressure. `pressure_pa` is its last answer.

    `commands` is what it commands, see `BuiltLaw`. `limits` have the ages from which a law that
    plans has watched nothing, `thresholds` the share of the pressure that a plan begins with, and
    the tank's period. The law's sample time is a whole number of ticks (`build_law`).
    """

    def __init__(
        self,
        law: Controller,
        measure: Measure,
        commands: tuple[str, ...] = (PRESSURE,),
        *,
        limits: SafetyLimits,
        thresholds: MonitorThresholds | None = None,
    ) -> None:
        self.law = law
        #: The law itself, where it is one that is exchanged for better ones while it runs.
        self.exchange = law if isinstance(law, LawExchange) else None
        self._engaged = self._interrupted = False
        self._measure = measure
        self._commands = commands
        self._limits, self._motion_ages_ms = limits, limits.motion_ages_ms
        self._allow = law.allow if isinstance(law, Plans) else None
        self._foresees = law if isinstance(law, Foresees) else None
        self._ends = law if isinstance(law, EndsByItself) else None
        self.foreseen_s = 0.0  #: How far ahead the waves were told to the last answer.
        self._starts_anew = isinstance(law, StartsAnew)
        self._samples = Schedule(round(law.sample_time_s / TICK_S) * TICK_NS)
        self._first_share = self._watched_share = 0.0
        self._watched_step = 1.0
        if thresholds is not None:
            # as before the water responds: less gained nothing, and hid wrong signs for longer
            self._first_share = thresholds.unconfirmed_share
            watched_s = WATCHED_PERIODS * thresholds.tank_period_s
            self._watched_step = law.sample_time_s / watched_s
        self._applied = np.zeros(len(commands))
        self._answered = False
        self._raised = False  # until the operator resets
        self.failed = False  #: Whether it raised an error, or its last answer is not finite.
        self.pressure_pa = self._valve_loss = 0.0
        #: What first went wrong with the law, an exception or an answer that is not finite; empty
        #: if nothing did.
        self.error = ""

    @property
    def fallbacks(self) -> int | None:
        """Plans that were not found in time, see `Plans`; None for a law that plans nothing."""
        return self.law.fallbacks if isinstance(self.law, Plans) else None

    @property
    def doubts_forecast(self) -> bool:
        """Whether the law ignores forecasts that the motion contradicts."""
        return self._foresees is not None and self._foresees.doubts_forecasts

    @property
    def passed_limit(self) -> bool:
        """Whether the law has ended by itself, at a limit of its own."""
        return self._ends is not None and self._ends.passed_limit != ""

    @property
    def state(self) -> RetuningState | None:
        """Where retuning stands; None without it."""
        return None if self.exchange is None else self.exchange.state

    @property
    def excused(self) -> bool:
        """Whether the roll says nothing of the law, see `LawExchange.excused`."""
        return self.exchange is not None and self.exchange.excused

    @property
    def designed_for(self) -> ModelSummary | ShipFigures | None:
        """Identified ship that the law in charge was designed for; None for the configuration's."""
        return None if self.exchange is None else self.exchange.laws.active.found

    @property
    def events(self) -> tuple[RetuningEvent, ...]:
        """What was done last to retune the law."""
        return () if self.exchange is None else tuple(self.exchange.events)

    def share(self, judgement: Judgement) -> float:
        """Share of the greatest pressure that the next plan may count on.

        It is the least of two: what is allowed while something is degraded, and what a law that
        plans has earned by watching the waves, a sample time after the other, from
        `unconfirmed_share` on.
        """
        if self._allow is None:
            return judgement.share
        return min(judgement.share, max(self._first_share, self._watched_share))

    def update(
        self,
        measured: Measurements,
        judgement: Judgement,
        level: LevelObserver,
        actuators: Actuators,
        take_order: TakeOrder,
    ) -> None:
        """Do one tick: answer when a sample is due, in charge or not.

        The `actuators` say what was applied, and are asked for the valve's loss.
        """
        self._interrupted |= judgement.demand is not _CONTROL
        due = self._samples.due(measured.now_ns)
        if due:
            actuators.note_applied(self._applied, self._commands, measured)
        try:
            if measured.arm_edge or measured.reset_edge:
                self._start_anew(measured, judgement)
            if not due:
                return
            motion = measured.motions[judgement.motion]
            if self._allow is not None:
                self._watch(measured, motion, judgement)
                self._allow(self.share(judgement))
            self._answer(measured, motion, judgement, level, take_order)
        except (Exception, SystemExit) as error:
            self.failed = self._raised = True
            self.error = self.error or f"{type(error).__name__}: {error}"
        if self.failed:
            self.pressure_pa = 0.0
        elif actuators.valve is not None:
            actuators.valve.ask(self._valve_loss)

    def _answer(
        self,
        measured: Measurements,
        motion: MotionSample,
        judgement: Judgement,
        level: LevelObserver,
        take_order: TakeOrder,
    ) -> None:
        """Set pressure and valve loss for the newest measurement."""
        # the command that left since the last answer: anti-windup and bumpless take-over
        if self._answered:
            self.law.applied(self._applied.copy())  # a law may keep it
        if self.exchange is not None:
            # in charge at the last answer and not since is for one answer out of charge
            in_charge = judgement.demand is _CONTROL
            self._engaged = in_charge and not (self._engaged and self._interrupted)
            self._interrupted = False
            self.exchange.update(
                measured.now_ns,
                take_order(measured.now_ns),
                engaged=self._engaged,
                fresh=is_fresh(measured, motion),
                passive_roll_rad=judgement.passive_roll_rad,
            )
        self._answered = True
        if self._foresees is not None and measured.forecast:
            self._foresee(self._foresees, measured)
        answer = self.law.step(self._measure(measured, motion, level))
        answered = dict(zip(self._commands, answer, strict=True))
        self.pressure_pa = pressure_pa = float(answered.get(PRESSURE, 0.0))
        self._valve_loss = float(answered.get(VALVE, 0.0))
        if not math.isfinite(pressure_pa + self._valve_loss):
            self.failed = True
            wrong = f"{pressure_pa:g} Pa"
            if math.isfinite(pressure_pa):
                wrong = f"a valve loss of {self._valve_loss:g}"
            self.error = self.error or f"its answer is {wrong}"
            self._forget()
        elif not self._raised:
            self.failed = False

    def _foresee(self, law: Foresees, measured: Measurements) -> None:
        """Hand on what is forecast of the waves, if it is not too old."""
        forecast = forecast_of(measured, self._limits.forecast_age_ms)
        law.preview(forecast)
        used = forecast is not None and not law.doubts_forecasts
        self.foreseen_s = float(forecast.time_s[-1]) if forecast is not None and used else 0.0

    def _start_anew(self, measured: Measurements, judgement: Judgement) -> None:
        """Reset a law that asks for it when an operator arms or resets, and one that raised."""
        # in charge a reset of a fault would take away what the law has learned meanwhile
        if self._starts_anew and judgement.mode is not _ACTIVE:
            self.law.reset()
        if self.failed and measured.reset_edge:
            self.failed = self._raised = False
            self._forget()

    def _watch(self, measured: Measurements, motion: MotionSample, judgement: Judgement) -> None:
        """Count what a law that plans has watched; it learns nothing in a gap."""
        limits, oldest_ms = self._limits, self._motion_ages_ms[judgement.motion]
        if motion.age_ms > oldest_ms or measured.tank_age_ms > limits.tank_age_ms:
            self._forget()
        else:
            self._watched_share += self._watched_step

    def _forget(self) -> None:
        """Have the law begin anew."""
        self.law.reset()
        self._watched_share = 0.0
