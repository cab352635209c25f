"""Heel removal at the quay: whether water, valve and heel do as they should.

The monitors of the sea say nothing here: behind a shut or throttled valve the water does not swing.
What is known instead is where the water creeps, from the pressures across the valve and its loss z:

    v = sqrt(dp / z) along dp,   dp = P - 2 rho g h + rho g L roll

* While the valve is off its seat the level follows v. If it moves less than a third as far it
  stands still: gauges, valve or pump. If it moves the other way a sign is wrong; if three times as
  far, the valve passes more than its opening lets through.
* While the valve is shut the level does not move. One that creeps away from its mean of ten minutes
  has a valve that leaks.
* After a pumping the mean heel has changed as the stiffness says. Cargo changes it, too: an answer
  is wrong only if it is wrong with and without the trend from before, and two in a row count. A
  ship aground, or held by its lines, answers too little; one whose stability is lost too much.
* At sea the ship rolls. The roll is told by its rate, which no heel changes.
"""

import math
from collections.abc import Callable
from typing import Final

from utank_hil.canbus.measurements import Measurements, MotionSample
from utank_hil.control.heel_removal import SETTLED_PERIODS, HeelingTank, HeelRemovalDesign, MeanHeel
from utank_hil.safety.monitors.finding import Finding

ROLL_MEMORY_S: Final = 60.0
SEAT: Final = 0.003
"""Opening up to which a valve counts as shut; heel removal opens it ten times as far and more."""
SEATED_S: Final = 3.0
"""Time after which the water behind a shut valve is at rest."""
TRAVEL_M: Final = 0.15
"""Way of the level after which it is judged: thirty times a gauge's noise."""
LEAST_LOSS: Final = 0.01
"""Of the throttle: an open valve has none, and water that swings goes no faster."""
FEW: Final = 1 / 3
MANY: Final = 3.0
"""Ways of less and more than this are wrong. The loss of a valve is known by half."""
LEAST_ANSWER: Final = 1 / 3
MOST_ANSWER: Final = 2.0
"""Of the heel that is due: less and more are no answer. Pumpings diverge from 2.9 on."""
USED_UP: Final = 0.95
"""Of the greatest level."""
LEAK_M: Final = 0.05
FAST_S: Final = 3.0
MEAN_S: Final = 600.0
LEAST_ANSWER_RAD: Final = 0.0017
"""Heel of a tenth of a degree: less is not judged."""
TREND_PERIODS: Final = 2.0
"""Of the roll, over which a trend of the heel is taken; it ends when the last pumping is forgotten.
"""
WRONG_ANSWERS: Final = 2
"""In a row: after more a tank of this kind is used up."""
LASTS_S: Final = 10.0
"""For so long what has been found lasts: it is latched by then, and can be reset after."""
NO_MARK: Final = (math.nan, 0.0)  # pragma: no mutate: before a first heel no time counts


class HarbourWatch:
    """The monitor of heel removal, fed every `period_s`.

    `loss` is the valve's in Pa per (m/s)^2 of the level's rate by its opening.
    """

    def __init__(
        self,
        tank: HeelingTank,
        design: HeelRemovalDesign,
        loss: Callable[[float], float],
        period_s: float,
    ) -> None:
        self._tank, self._design, self._loss, self._period_s = tank, design, loss, period_s
        # of a roll at the ship's own period
        rate_rad_s = design.most_roll_rad * 2 * math.pi / tank.roll_period_s
        self._most_square = rate_rad_s * rate_rad_s
        self._square, self._used_up_m = 0.0, USED_UP * tank.most_m
        self._mean = MeanHeel(tank.roll_period_s, period_s)
        self._settled_s = SETTLED_PERIODS * tank.roll_period_s
        self._apart_s = TREND_PERIODS * tank.roll_period_s
        self._shut_s = self._moved_s = 0.0
        self._marks = NO_MARK, NO_MARK  # mean heels while shut, and when
        self._heel_rad = self._trend_rad_s = self._level_m = math.nan  # as a pumping began
        self._least_loss = LEAST_LOSS * tank.throttle_loss
        self._begin_travel(math.nan)  # unknown where it starts with an open valve
        self._too_little = self._too_much = 0
        self._told_s = 0.0

    def balance_pa(self, level_m: float, roll_rad: float) -> float:
        """Pressure of pump and valve together on water that is held, or creeps."""
        return self._tank.balance_pa(level_m, roll_rad)

    def update(self, motion: MotionSample, measured: Measurements, steps: int) -> int:
        """Take what is measured, `steps` periods after the last; return what was found."""
        period_s = steps * self._period_s
        for _ in range(steps):
            self._mean.update(motion.roll_rad)
        rate_rad_s = motion.roll_rate_rad_s
        self._square += period_s / ROLL_MEMORY_S * (rate_rad_s * rate_rad_s - self._square)
        self._told_s -= period_s
        if self._told_s < 0:
            self._told = 0
        self._moved_s += period_s
        level_m = measured.level_m
        found = Finding.NOT_IN_HARBOUR if self._square > self._most_square else 0
        if measured.valve_opening <= SEAT:
            found |= self._look_at_held(level_m, period_s)
        else:
            self._look_at_moved(measured, motion.roll_rad, period_s)
        return found | self._told

    def _look_at_held(self, level_m: float, period_s: float) -> int:
        before_s, self._shut_s = self._shut_s, self._shut_s + period_s
        if before_s < self._settled_s <= self._shut_s:
            self._judge_answer(level_m)
        self._mark()
        if self._shut_s < SEATED_S:
            self._fast_m = self._mean_m = level_m
            return 0
        self._fast_m += period_s / FAST_S * (level_m - self._fast_m)
        self._mean_m += period_s / MEAN_S * (self._fast_m - self._mean_m)
        found = Finding.VALVE_PASSES if abs(self._fast_m - self._mean_m) > LEAK_M else 0
        off_rad = self._mean.heel_rad - self._design.target_rad
        across_m = -math.copysign(1.0, off_rad) * level_m
        if abs(off_rad) > self._design.start_rad and across_m > self._used_up_m:
            found |= Finding.TANK_USED_UP
        return found

    def _look_at_moved(self, measured: Measurements, roll_rad: float, period_s: float) -> None:
        level_m = measured.level_m
        if self._shut_s > 0:
            if self._shut_s < self._settled_s:
                self._judge_answer(level_m)
            self._heel_rad, self._level_m = self._mean.heel_rad, level_m
            before_rad, before_s = self._marks[0]
            self._trend_rad_s = (self._heel_rad - before_rad) / (self._shut_s - before_s)
            self._marks = NO_MARK, NO_MARK
            self._shut_s = self._moved_s = 0.0
            self._begin_travel(level_m)
        driving_pa = measured.pressure_pa - self._tank.balance_pa(level_m, roll_rad)
        loss = max(self._loss(measured.valve_opening), self._least_loss)
        speed_m_s = math.sqrt(abs(driving_pa) / loss)
        self._travel_m += math.copysign(speed_m_s, driving_pa) * period_s
        moved_m = level_m - self._begin_m
        if self._travel_m < 0:
            moved_m = -moved_m
        way_m = abs(self._travel_m)
        if moved_m > max(MANY * way_m, TRAVEL_M):
            self._tell(Finding.VALVE_PASSES)
        elif way_m >= TRAVEL_M:
            if moved_m < -FEW * way_m:
                self._tell(Finding.WATER_SIGN)
            elif moved_m < FEW * way_m:
                self._tell(Finding.LEVEL_STUCK)
            self._begin_travel(level_m)

    def _begin_travel(self, level_m: float) -> None:
        self._begin_m, self._travel_m = level_m, 0.0

    def _mark(self) -> None:
        """Keep the heel now and a while ago, once it has followed the last pumping."""
        since_s = self._shut_s - self._marks[1][1]
        if since_s >= self._apart_s and self._shut_s >= self._settled_s - self._apart_s:
            self._marks = self._marks[1], (self._mean.heel_rad, self._shut_s)

    def _judge_answer(self, level_m: float) -> None:
        """Compare the change of the mean heel since a pumping began with what was moved."""
        due_rad = self._tank.heel_per_m * (level_m - self._level_m)
        if not abs(due_rad) >= LEAST_ANSWER_RAD:  # False for NaN, before the first pumping
            return
        changed_rad = self._mean.heel_rad - self._heel_rad
        without_rad = changed_rad - self._trend_rad_s * self._moved_s
        answers = changed_rad / due_rad, without_rad / due_rad
        self._too_little = self._too_little + 1 if max(answers) < LEAST_ANSWER else 0
        self._too_much = self._too_much + 1 if min(answers) > MOST_ANSWER else 0
        if self._too_little >= WRONG_ANSWERS:
            self._tell(Finding.HEEL_UNANSWERED)
        if self._too_much >= WRONG_ANSWERS:
            self._tell(Finding.HEEL_OVERDONE)

    def _tell(self, finding: int) -> None:
        self._told, self._told_s = self._told | finding, LASTS_S
        self._too_little = self._too_much = 0
