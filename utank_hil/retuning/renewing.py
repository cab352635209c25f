"""A self-tuned law that is renewed under way for the waves and the ship estimated from the motion.

`LawExchange` has the states. The ship is not excited: a request holds the latest estimate
(`Estimator`). It is made when waves or ship differ from those that the present law was designed
for.

A law may be wrong for waves or a ship that are not known yet. So it gets that share of the pressure
which pays (`Effort`), and it plans at the limits only for an identified ship: on one loaded
otherwise the plan swings the water from limit to limit, where the clipped law is stable.
"""

import dataclasses
import math
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningState, Verdict
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw
from utank_hil.control.interface import Controller, PumpLimits
from utank_hil.control.lqg import GentleController
from utank_hil.retuning.answer import Answer, RenewedLaw
from utank_hil.retuning.estimate import ChangeMonitor, MotionEstimate, ShipFigures, ship_factor
from utank_hil.retuning.law_bank import MonitoredLaw, WarmUp
from utank_hil.retuning.law_exchange import ANOTHER_QUESTION, RETRY_NS, LawExchange
from utank_hil.retuning.retuner import Retuner
from utank_hil.retuning.settings import EARLIEST_VERDICT_S, TrialSettings
from utank_hil.retuning.trial import NOISE_FLOOR, WindowStatistics
from utank_hil.sea import SlopeSpectrum

SEA_DIFFERENCE: Final = 0.2
"""Smallest `sea_difference` for which a law is renewed: that of waves a fifth higher."""
SHIP_DIFFERENCE: Final = 1.05
"""Smallest factor in roll period, or in the root of the stiffness, for which a law is renewed."""
LONGER: Final = 1.3
"""Factor in length of the record from which a law is renewed for the same, better known waves."""
TRIAL: Final = TrialSettings(
    trial_s=180.0, roll_factor=1.25, effort_factor=1.5, answer_within_s=300.0
)
TRIAL_PERIODS: Final = 14.0
"""Roll periods of a trial of a slow ship: what 180 s are of the first ship."""
LEAST_SHARE: Final = 1e-3
"""Smallest limits of a law relative to the pump's: below, it does nothing and is ill-conditioned.
"""
LEAST_ROLL_RAD: Final = math.radians(0.25)
"""Root mean square of the roll below which laws are not compared. Chosen; no study."""
AWAY: Final = 5.0
"""Ratio to the roll before, or the passive ship's if larger, at which a trial ends at once. A law
that is unstable on the ship doubles the roll in a second or two. A sudden large heel ends a trial
too; the law is tried again later.
"""
LEAST_EFFORT: Final = 0.005
"""Least share: the pump's effect is computed, so it needs no more to be known."""
LIMITED_EFFORT: Final = 0.05
"""Least share, of gain and of pressure, after limits have changed the command by more than that.
What they make of the roll counts as the law's, and a smaller share would leave it as it is: then
the share that pays seems to be ever smaller."""
FIRST_EFFORT: Final = 0.5
"""Share before anything is known: a quarter of the power, three quarters of most of the gain."""
MEMORY_PERIODS: Final = 8.0
"""Roll periods in the means; five and eight gave the same roll in eleven seas."""
EFFORT_PACE: Final = 2.0  #: Speed of the share over that of the means.

_AT_REST_AFTER: Final = (RetuningState.REFUSED, RetuningState.UNDONE)


class Effort:
    """Share of the pressure that pays: predicted from what the pump has made of the roll so far.

    The ship's roll is that of the passive twin plus the roll d that the pump made. With the share s
    of the pressure it made d, so with another share it would make about d times that ratio: with
    gains for less pressure (`GentleController`) its phase is then about the same. The mean square
    of the roll is least at the share ``-s mean(twin d) / mean(d d)``, with means about the mean
    values and an exponential memory. A law that only rolls the ship more thus ends at
    `LEAST_EFFORT`, next to no power, and comes back as soon as it helps. A ship that is not the
    twin's makes d wrong by as much as its answer to the pump differs: in short waves, loaded to 1.3
    times its roll period, it gets less pressure than would pay.

    A law that plans within its share does not do the same on a smaller scale: its plans come out
    with another phase. It gets all of the pressure while the ship rolls less than the twin.

    `samples` are those of a roll period.
    """

    def __init__(self, samples: float) -> None:
        self._part = 1.0 / (MEMORY_PERIODS * samples)
        self.clear()

    def clear(self, share: float = FIRST_EFFORT) -> None:
        """Forget everything, and begin with a share."""
        self.share = share
        self._twin_rad = self._made_rad = self._together = self._made_square = self._limited = 0.0

    def update(
        self, roll_rad: float, passive_roll_rad: float, *, limited: bool, plans: bool = False
    ) -> None:
        """Take a sample; with an unknown passive roll the share goes to one.

        `limited` if limits have changed the last command (`LIMITED_EFFORT`), `plans` if the law
        plans within its share.
        """
        best, part = 1.0, self._part
        self._limited = 1.0 if limited else (1.0 - part) * self._limited
        least = LEAST_EFFORT + self._limited * (LIMITED_EFFORT - LEAST_EFFORT)
        if math.isfinite(roll_rad + passive_roll_rad):
            twin, made = passive_roll_rad - self._twin_rad, roll_rad - passive_roll_rad
            made -= self._made_rad
            self._twin_rad += part * twin
            self._made_rad += part * made
            self._together += part * (twin * made - self._together)
            self._made_square += part * (made * made - self._made_square)
            if self._made_square > 0.0:
                best = -self.share * self._together / self._made_square
                if plans and best > 0.5 * self.share:  # the mean square is below the twin's
                    best = 1.0
        self.share += EFFORT_PACE * part * (min(max(best, least), 1.0) - self.share)


class RenewingController(LawExchange):
    """A constrained law that is renewed as waves and ship change.

    `law` is the first one, for an unknown sea, and `controller` steps it; `ship` is the configured
    one, `roll` the index of the roll among the outputs. No law may exceed `limits`. A controller
    that plans from the start gets its whole command, as only its plan keeps the level.
    """

    def __init__(
        self,
        law: ConstrainedLaw,
        controller: Controller,
        ship: ShipFigures,
        roll: int,
        limits: PumpLimits,
        retuner: Retuner,
    ) -> None:
        self._shared = isinstance(controller, GentleController)
        first = MonitoredLaw(controller, ChangeMonitor(ship))
        slow = max(1.0, TRIAL_PERIODS * ship.roll_period_s / TRIAL.trial_s)
        trial = dataclasses.replace(TRIAL, trial_s=slow * TRIAL.trial_s)
        earliest_s = slow * EARLIEST_VERDICT_S
        super().__init__(first, len(law.model.C), roll, trial, retuner, earliest_s=earliest_s)
        self._law = law
        self._limits = limits
        self._configured = self._ship = ship
        self.effort = Effort(ship.roll_period_s / self.sample_time_s)
        self._allowed = 1.0
        self._asked_pa = 0.0
        self._latest: MotionEstimate | None = None
        self._seen: ShipFigures | None = None
        self._due = ""
        self._asked: MotionEstimate | None = None
        self.renewed: RenewedLaw | None = None  #: Latest admitted law.
        self.fallbacks = 0  #: Fallbacks (`Plans`) of all laws together.

    def allow(self, share: float) -> None:
        """Set the share of the pressure limit that every law of the bank may use (`Plans`)."""
        self._allowed = share

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement and return the command; see `Controller`."""
        share = self.effort.share if self._shared else 1.0
        for law in self.laws.stepped:  # as each may become active next
            if isinstance(law.controller, ConstrainedController):
                law.controller.allow(self._allowed * share)
            elif isinstance(law.controller, GentleController):
                law.controller.use(share)
        controller = self.laws.active.controller
        before = controller.fallbacks if isinstance(controller, ConstrainedController) else 0
        command = float(super().step(y, reference)[0])
        if isinstance(controller, ConstrainedController):
            self.fallbacks += controller.fallbacks - before
        if not self._engaged:
            self.effort.clear()
        elif self._fresh and self._shared:
            changed_pa = abs(self._applied_pa - self._asked_pa)
            limited = changed_pa > LIMITED_EFFORT * self._limits.pressure_pa
            plans = isinstance(controller, ConstrainedController)
            roll_rad, passive_rad = self._roll_rad, self._passive_roll_rad
            self.effort.update(roll_rad, passive_rad, limited=limited, plans=plans)
        allowed_pa = self._allowed * self._limits.pressure_pa
        self._asked_pa = min(max(command, -allowed_pa), allowed_pa)
        return np.array([self._asked_pa])

    def reset(self) -> None:
        """Reset all laws; a law on trial is dropped."""
        super().reset()
        self.fallbacks = 0

    @property
    def excused(self) -> bool:
        """False: the law is judged at all times."""
        return False

    def note(self, estimate: MotionEstimate) -> None:
        """Take an estimate of waves and ship."""
        for law in self.laws.stepped:
            law.monitor.watch(estimate)
        if estimate.waves is None or estimate.ship is None:
            self._latest, self._due = None, ""  # No law is designed for waves that have passed.
            return
        if estimate.of_ship is Verdict.GOOD:
            now, before, self._seen = estimate.ship, self._seen, estimate.ship
            known = [ship for ship in (self._ship, before) if ship is not None]
            if all(ship_factor(now, ship) > SHIP_DIFFERENCE for ship in known):
                # A law for another ship, or for waves seen with it, needs two estimates.
                self._latest, self._due = None, ""
                return
            self._ship = now
        self._latest = dataclasses.replace(estimate, ship=self._ship)
        self._due = _reason(self._latest, self.laws.active)

    def _automatic_reason(self) -> str:
        return self._due if self._now_ns >= self._not_before_ns else ""

    def _begin(self, reason: str) -> None:
        self._due = ""
        self._asked = self._latest
        if self._asked is None:
            self._abort(f"{reason}, but the waves are not known: try again later")
            return
        self._submit(self._asked, reason)

    def _admit(self, answer: Answer) -> WarmUp | str:
        if not isinstance(answer, RenewedLaw):
            return ANOTHER_QUESTION
        law, first = answer.law, self._law
        same = (law.sample_time_s, len(law.model.C), law.level_output)
        if same != (first.sample_time_s, len(first.model.C), first.level_output):
            return "the law is for other signals or another sample time"
        most, asked = self._limits, law.limits
        if not (
            asked.pressure_pa <= most.pressure_pa
            and asked.rate_pa_s <= most.rate_pa_s
            and asked.level_m <= most.level_m
            and asked.power_w <= most.power_w
        ):
            return "the law is for a stronger pump or a larger tank"
        if asked.pressure_pa < LEAST_SHARE * most.pressure_pa or (
            asked.rate_pa_s < LEAST_SHARE * most.rate_pa_s
        ):
            return "the law is for a pump that does next to nothing"
        assert self._asked is not None
        ship = self._asked.ship
        assert ship is not None
        found = None if ship is self._configured else ship
        try:
            clips = found is None and self._shared
            controller = law.clipped() if clips else law.controller()
        except (ValueError, ArithmeticError) as error:
            return str(error)
        self.renewed = answer
        service = MonitoredLaw(controller, ChangeMonitor(ship), found, self._asked)
        return WarmUp(service, self._history)

    def _put_on_trial(self, law: MonitoredLaw) -> None:
        super()._put_on_trial(law)
        if self._shared and isinstance(law.controller, ConstrainedController):
            self.effort.clear(1.0)  # a plan for less pressure has another phase, and may be worse

    def _check_trial(self) -> None:
        before, now = self._baseline, self._trial_window.statistics
        passive_rad = max(before.passive_roll_rad, now.passive_roll_rad)
        usual_rad = max(LEAST_ROLL_RAD, before.roll_rad, passive_rad)
        away_rad = abs(self._roll_rad - self._heel_rad)
        if away_rad > AWAY * usual_rad:
            away = f"{math.degrees(away_rad):.1f} degrees from the heel before"
            self._refuse(
                (f"the ship is {away}, {away_rad / usual_rad:.1f} times the roll before, RMS",)
            )
            return
        super()._check_trial()

    def _to_compare_with(self, tried: WindowStatistics) -> WindowStatistics:
        """Return what the previous law would have had in the waves of the trial.

        Both are scaled with the roll of the passive ship, and the roll is limited to it. In greater
        waves the pump's limits may leave what it took off before, and no more. The pressure may be
        the one predicted for the new law in these waves.
        """
        before, renewed = self._baseline, self.renewed
        assert renewed is not None
        passive_rad, most_pa = tried.passive_roll_rad, self._limits.pressure_pa
        roll_rad, grown, taller = before.roll_rad, 1.0, 1.0
        passive_before_rad = before.passive_roll_rad
        if self.laws.accepted.monitor.change > 1.0:  # its twin was another ship
            passive_before_rad = min(passive_before_rad, renewed.passive_roll_rad)
        if min(passive_before_rad, passive_rad) > NOISE_FLOOR.roll_rad:
            grown = passive_rad / passive_before_rad
            taken_off_rad = max(0.0, passive_before_rad - roll_rad)
            roll_rad = passive_rad - min(1.0, grown) * taken_off_rad
            taller = max(1.0, passive_rad / max(renewed.passive_roll_rad, NOISE_FLOOR.roll_rad))
        predicted_pa = taller * renewed.pressure_pa
        pressures_pa = [
            min(most_pa, max(max(1.0, grown) * pa, predicted_pa))
            for pa in (before.pressure_pa, before.pressure_rms_pa)
        ]
        return WindowStatistics(roll_rad, *pressures_pa)

    def _on_trial(self) -> str:
        renewed, asked = self.renewed, self._asked
        assert renewed is not None
        assert asked is not None
        assert asked.ship is not None
        height = f"Hs {asked.hs_m:.2f} m, Tp {asked.tp_s:.1f} s"
        if math.isnan(asked.hs_m):
            height = "waves of unknown height"
        return (
            f"renewed for {height}, roll period "
            f"{asked.ship.roll_period_s:.2f} s: predicted roll "
            f"{math.degrees(renewed.roll_rad):.2f} degrees, with the passive tank "
            f"{math.degrees(renewed.passive_roll_rad):.2f}"
        )

    def _accept(self) -> None:
        self._finish(RetuningState.RETUNED, self._on_trial())

    def _finish(self, state: RetuningState, *reasons: str) -> None:
        if self.laws.on_trial is not None or state is RetuningState.UNDONE:
            self.effort.clear()
        if state in _AT_REST_AFTER:
            self._not_before_ns = self._now_ns + RETRY_NS
        super()._finish(state, *reasons)


def _reason(now: MotionEstimate, law: MonitoredLaw) -> str:
    """Return why a law should be renewed, in words; empty if it should not."""
    if law.monitor.change > SHIP_DIFFERENCE:
        return f"the ship has changed by a factor of {law.monitor.change:.2f}"
    then = law.estimate
    if then is None or then.waves is None or now.waves is None:
        return "the waves are known now"
    if now.duration_s > LONGER * then.duration_s:
        return f"the waves are known from a longer record, {now.duration_s / 60:.0f} minutes"
    difference = sea_difference(now.waves, then.waves)
    if difference > SEA_DIFFERENCE:
        return f"the waves differ by {difference:.0%} from those of the law"
    return ""


def sea_difference(now: SlopeSpectrum, then: SlopeSpectrum) -> float:
    """RMS difference of amplitudes over those `then`: 0 for equal seas, 0.2 for a fifth more."""
    before = then.slope_density(now.omega_rad_s)
    apart = float(np.sum(np.square(np.sqrt(now.density) - np.sqrt(before))))
    energy = float(np.sum(before))
    return math.sqrt(apart / energy) if energy > 0 else math.inf
