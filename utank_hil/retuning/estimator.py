"""Estimator in the loop: keeps the motion record and requests estimates from it.

As soon as it tells the waves, and then every `every_s`, the record goes to the retuner's process
(`estimating`). The ship is not excited, and the loop does not wait.
"""

import math
from dataclasses import dataclass
from math import nan
from typing import Annotated, Final

import numpy as np

from utank_hil.base.parameters import Checked, Range
from utank_hil.canbus import SeaEstimate, ShipEstimate, Verdict
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank, coupled_matrices
from utank_hil.retuning.answer import Refusal
from utank_hil.retuning.estimate import EstimateRequest, MotionEstimate, ShipFigures
from utank_hil.retuning.law_bank import SampleHistory
from utank_hil.retuning.retuner import Retuner

COLUMNS: Final = ("roll_rad", "roll_rate_rad_s", "level_m")
"""Columns of the motion record."""
SAMPLE_TIME_S: Final = 0.2
"""Sample time of the record; its Nyquist frequency is six times `motion_fit.TOP_RAD_S`."""
SEA_PERIODS: Final = 14.0
"""Shortest record of the waves in natural roll periods: 8 gave no better laws (retuning.md)."""
SHIP_PERIODS: Final = 45.0
"""Shortest record of the ship in its roll periods: 20 left 11 % in the period (retuning.md)."""
LONGEST_RECORD_S: Final = 3600.0  #: Longest record: a sea counts as stationary for one hour.
OUTDATED: Final = 3.0  #: Number of intervals after which an estimate is outdated: two may fail.
SHIP_OUTDATED_S: Final = 3600.0
"""Time for which an identified ship is shown, or three intervals if that is longer. Within an hour
loading and tanks hardly change a ship at sea.
"""
GM_DEVIATIONS: Final = 2.0
"""Number of standard deviations from the metacentric height to the lower end of its interval."""


@dataclass(frozen=True, slots=True)
class EstimateSettings(Checked, owner="sea estimate"):
    """Settings of the estimate of waves and ship: section ``sea_estimate`` of a controller.

    Raises `ValueError` if a value is out of its range.
    """

    every_s: Annotated[float, Range(least=30, most=3600)] = 180.0  #: Time between two estimates.
    #: Length of the record.
    record_s: Annotated[float, Range(least=300, most=LONGEST_RECORD_S)] = 1200.0
    #: Ratio of effective to true wave slope, for the wave height.
    effective_slope: Annotated[float, Range(above=0, most=2)] = 0.5
    #: Whether a self-tuned law is redesigned when the estimated waves or ship differ from those
    #: that the present law was designed for.
    renew: bool = False

    @property
    def samples(self) -> int:
        """Length of the record in samples."""
        return round(self.record_s / SAMPLE_TIME_S)


_NO_SEA: Final = SeaEstimate(Verdict.RECORD_SHORT, *(nan,) * 5)
_NO_SHIP: Final = ShipEstimate(*_NO_SEA)


@dataclass(slots=True)
class EstimateFigures:
    """Estimates for panels and telemetry, as they go onto the bus; NaN while unknown."""

    #: Height and peak period of beam waves; root mean square of the wave moment per roll stiffness
    #: and its relative standard deviation; time since the end of the record.
    sea: SeaEstimate = _NO_SEA
    #: Ship that was identified last, without tank water, NaN if that is too old; metacentric height
    #: with free tank water, NaN also if the displacement is unknown.
    ship: ShipEstimate = _NO_SHIP
    #: Whether the interval of the last metacentric height reaches below the limit of the stability
    #: booklet, or estimates have ceased; False without a limit.
    gm_low: bool = False

    def words(self) -> tuple[str, ...]:
        """The estimate in words."""
        of_sea, hs_m, tp_s, moment_rms_rad, moment_deviation, _ = self.sea
        of_ship, period_s, period_deviation_s, gm_m, gm_deviation_m, _ = self.ship
        assert of_sea is not None
        assert of_ship is not None
        sea, ship = f"sea {of_sea.name}", f"ship {of_ship.name}"
        if not math.isnan(hs_m):
            sea += (
                f": {hs_m:.2f} m, {tp_s:.1f} s as beam waves, wave moment "
                f"{math.degrees(moment_rms_rad):.2f} degrees +- {moment_deviation:.0%}"
            )
        if of_ship is Verdict.GOOD:
            ship += f": roll period {period_s:.2f} +- {period_deviation_s:.2f} s"
            if not math.isnan(gm_m):
                ship += f", GM {gm_m:.2f} +- {gm_deviation_m:.2f} m"
        return sea, ship

    def forget_ship(self) -> None:
        """Clear the ship's figures; its verdict and age go on."""
        self.ship = _NO_SHIP._replace(verdict=self.ship.verdict, age_s=self.ship.age_s)


def metacentric_height_m(ship: RollShip, tank: Tank, stiffness_nm_rad: float) -> float:
    """Return the metacentric height of ship and tank with free water; NaN without a displacement.

    `ship` has the displacement; `stiffness_nm_rad` is the roll stiffness without tank water.
    """
    if not ship.displacement_n > 0:
        return nan
    stiffness = coupled_matrices(ship, tank)[2]
    free = stiffness[0, 0] - stiffness[0, 1] * stiffness[0, 1] / stiffness[1, 1]
    weight_n = ship.displacement_n + GRAVITY_M_S2 * tank.water_kg
    return float(free + stiffness_nm_rad - ship.stiffness_nm_rad) / weight_n


class Estimator:
    """Keeps the record, requests estimates, and holds the latest.

    `desk` answers with a `MotionEstimate`; `least_gm_m` is the limit of the stability booklet on
    the metacentric height.
    """

    def __init__(
        self,
        settings: EstimateSettings,
        desk: Retuner,
        ship: RollShip,
        tank: Tank,
        least_gm_m: float | None = None,
    ) -> None:
        self._settings = settings
        self._every_ns = round(settings.every_s * 1e9)
        # a roll more, in which the sensors come
        self._first_ns = round((SEA_PERIODS + 1) * 2e9 * math.pi / ship.natural_frequency_rad_s)
        self._outdated_ns = round(OUTDATED * settings.every_s * 1e9)
        self._ship_outdated_s = max(SHIP_OUTDATED_S, OUTDATED * settings.every_s)
        self._desk = desk
        self._ship, self._tank = ship, tank
        self._least_gm_m = least_gm_m
        self._low = False
        self._history = SampleHistory(settings.samples, len(COLUMNS))
        self._motion = np.zeros(len(COLUMNS))
        self._known = ShipFigures.of(ship)
        self._number = 0
        self._due_ns: int | None = None
        self._asked_ns: int | None = None
        self._since_ns = 0  # The end of the latest estimate's record, or the start.
        self._ship_ns: int | None = None
        self.trouble = ""  #: First known reason why no estimates come; empty while they do.
        self._news: list[str] = []
        self.figures = EstimateFigures()

    def sample(
        self, now_ns: int, motion: tuple[float, float, float], *, fresh: bool
    ) -> MotionEstimate | None:
        """Take a sample every `SAMPLE_TIME_S`; return a new estimate if there is one.

        When the last estimate has become outdated, one that says only OUTDATED is returned.
        `motion` is roll, roll rate and level; `fresh` says whether all are new measurements.
        """
        self._motion[:] = motion
        self._history.add(0.0, self._motion, fresh=fresh)  # whatever the pump does
        if self._due_ns is None:
            self._due_ns = now_ns + self._first_ns
            self._since_ns = max(now_ns, self._due_ns - self._every_ns)
        came = None
        if self._asked_ns is not None:
            came = self._look(self._asked_ns, now_ns)
        elif now_ns >= self._due_ns and self._desk.alive:
            self._due_ns = now_ns + self._every_ns
            self._number += 1
            self._asked_ns = now_ns
            record = self._history.record(self._history.capacity)[:, 1:]
            self._desk.submit(self._number, EstimateRequest(self._known, record), now_ns)
        self._grow_old(now_ns)
        outdated = self.figures.sea.verdict is Verdict.OUTDATED
        if now_ns - self._since_ns > self._outdated_ns and not outdated:
            came = self._give_up(now_ns)
        return came

    def take_news(self) -> tuple[str, ...]:
        """Return the messages for people since the last call."""
        news, self._news = tuple(self._news), []
        return news

    def _look(self, asked_ns: int, now_ns: int) -> MotionEstimate | None:
        """Check for the answer."""
        answer = self._desk.answer(self._number, now_ns)
        if answer is None:
            return None
        self._asked_ns = None
        if not isinstance(answer, MotionEstimate):
            reasons = answer.reasons if isinstance(answer, Refusal) else ("it is no estimate",)
            self._fail("; ".join(reasons))
            return None
        if now_ns - asked_ns > self._outdated_ns:
            return None
        if self.trouble:
            self.trouble = ""
            self._news.append("there are estimates of sea and ship again")
        self._since_ns = asked_ns
        ship = answer.ship
        if answer.of_ship is Verdict.GOOD and ship is not None:
            self._ship_ns = asked_ns
            self._known = ship
            self._show_ship(ship)
        self._show(answer, 0.0)
        self.figures.gm_low = self._low
        self._news += self.figures.words()
        return answer

    def _give_up(self, now_ns: int) -> MotionEstimate:
        """Report that waves and ship are no longer known."""
        outdated = MotionEstimate(Verdict.OUTDATED, Verdict.OUTDATED)
        figures, silent_s = self.figures, (now_ns - self._since_ns) * 1e-9
        if not self.trouble:
            self._fail(
                f"nothing was heard for {silent_s:.0f} s of the process that estimates: "
                "it is dead, hangs or is too busy"
            )
        last = f"the last estimate is {silent_s:.0f} s old"
        if math.isnan(figures.sea.age_s):
            last = "there was none"
        self._news.append(f"sea and ship are not known now: {last}")
        self._show(outdated, figures.sea.age_s)
        figures.forget_ship()
        figures.gm_low = self._least_gm_m is not None
        return outdated

    def _show(self, found: MotionEstimate, age_s: float) -> None:
        rms_rad = nan if found.waves is None else found.waves.rms_rad
        figures = self.figures
        figures.sea = SeaEstimate(
            found.of_sea, found.hs_m, found.tp_s, rms_rad, found.rms_deviation, age_s
        )
        figures.ship = figures.ship._replace(verdict=found.of_ship)

    def _fail(self, reason: str) -> None:
        if not self.trouble:  # The trouble is reported once.
            self.trouble = reason
            self._news.append(f"no estimates of sea and ship: {reason}")

    def _show_ship(self, ship: ShipFigures) -> None:
        period_s, deviation_s = ship.roll_period_s, ship.period_deviation * ship.roll_period_s
        gm_m, less_m = (
            metacentric_height_m(self._ship, self._tank, ship.stiffness_nm_rad * factor)
            for factor in (1.0, 1.0 - ship.stiffness_deviation)
        )
        self.figures.ship = ShipEstimate(
            Verdict.GOOD, period_s, deviation_s, gm_m, gm_m - less_m, self.figures.ship.age_s
        )
        least_m = gm_m - GM_DEVIATIONS * (gm_m - less_m)
        self._low = self._least_gm_m is not None and least_m < self._least_gm_m

    def _grow_old(self, now_ns: int) -> None:
        figures = self.figures
        if not math.isnan(figures.sea.age_s):
            figures.sea = figures.sea._replace(age_s=(now_ns - self._since_ns) * 1e-9)
        if self._ship_ns is None:
            return
        age_s = (now_ns - self._ship_ns) * 1e-9
        figures.ship = figures.ship._replace(age_s=age_s)
        if age_s > self._ship_outdated_s and not math.isnan(figures.ship.roll_period_s):
            figures.forget_ship()
            self._news.append(
                "roll period and GM are not known any more: "
                f"the ship was last identified {age_s / 60:.0f} minutes ago"
            )
