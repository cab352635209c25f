"""The tank's own equation: whether the water moves as roll and pressure push it.

With the level h, the roll phi and the pump's pressure P, thesis (2.19) per mass of water is ::

    Le h'' + (c + q |h'|) h' + 2 g h  =  P / rho  +  g L phi + L (H + Lz) phi''
              y, what the water shows      p                 x

A ship that sways takes c u from the right side, with u = L g times the slope of the waves, as the
moment that rolls the ship tells it (`SlopePush`), and c anything from 0 to `most_sway`.
All three are low-pass filtered alike, with both poles at 2 w0, which gives the derivatives without
differentiating. Sums with a memory of 0.4 roll periods tell the gains::

    roll   sum((y - p) x) / sum(x x)               1; -1 with the motion sensor's sign wrong
    pump   sum((y - x) p) / sum(p p)               1; -1 with the pump's sensor wrong
    level  sum(y (p + x)) / sum((p + x) (p + x))   1; -1 with the gauges swapped, 0 if stuck

and what leads y - p - x the measured roll tells the motion sensor's delay, over 1.5 roll periods.
Where the roll has not moved for a quarter of a period, y - p - x itself tells that it should have.
No sensor's zero is quite right: y - p - x may hold any constant up to +-z, as a commissioning lets
pass. Something is found only if no constant of that size explains it.
The sums hold the middle of the range, and no sway within it may explain what is found: for each
frequency a c within a circle about the middle, since sway need not be in phase with the slope.
The ship's inertia, stiffness and load stand in u alone. A gain is judged only where its own
push is large enough, in itself and beside the other one: an error of the model of 3 % of a push
sixteen times as large is half of it. What a valve holds back is known less well than what a pump
presses: the roll's push has to be larger beside it.
"""

import math
from typing import Final

from utank_hil.base.elementary import exp
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.safety.monitors.derivative_filter import DerivativeFilter
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import within
from utank_hil.safety.monitors.sway import SlopePush, most_sway
from utank_hil.safety.monitors.thresholds import MonitorThresholds

SIGN_GAIN: Final = -0.25
VALVE_SIGN_GAIN: Final = -0.5
"""The same behind a valve: one that holds back half as much again as configured makes it -0.23."""
SETTLED: Final = 6.0
"""Time constants of the filters after which their start is forgotten."""
STUCK_GAIN: Final = 0.3
STILL_PERIODS: Final = 0.25
STILL_PUSHES: Final = 4.0
"""Of the least push, root mean square: so much must be left unexplained by a roll that is still."""
MEMORY_PERIODS: Final = 0.4
LATE_PERIODS: Final = 1.5
LATE_PUSHES: Final = 1.75
"""Of the least push: with less, noise looked like a delay in healthy hours of calm sea."""
LEAST_SHARE: Final = 0.06
"""Of one push beside the other one."""
VALVE_SHARE: Final = 0.2
"""Of the pump's push beside the roll's, where there is a valve."""
HELD_SHARE: Final = 0.3
"""Of the roll's push beside what a valve holds back."""
FULL_SHARE: Final = 0.9
"""Of the tank's height: beyond, roof and bottom push too."""

_WATER_SIGN: Final = int(Finding.WATER_SIGN)
_PUMP_SIGN: Final = int(Finding.PUMP_SIGN)
_LEVEL_STUCK: Final = int(Finding.LEVEL_STUCK)
_LATE: Final = int(Finding.MOTION_LATE)
_ROLL_STUCK: Final = int(Finding.ROLL_STUCK)


def roll_push_at_natural_frequency(ship: RollShip, tank: Tank) -> float:
    """Push on the water per roll that swings at w0, in m^2/(s^2 rad): x / phi."""
    mass, _, stiffness = coupled_matrices(ship, tank)
    frequency = tank.natural_frequency_rad_s
    push = mass[1, 0] * frequency * frequency - stiffness[1, 0]
    return float(push / (tank.density_kg_m3 * tank.reservoir_area_m2))


class TankEquation:
    """Gains of roll, pump and level in the tank's equation.

    Parameters
    ----------
    ship : RollShip
    tank : Tank
    thresholds : MonitorThresholds
    period_s : float
        Time between two updates.
    valve : bool
        Whether the pressure holds what a valve takes, as it is estimated.

    Attributes
    ----------
    roll_gain, pump_gain, level_gain : float
        See the module; NaN as long as the push is too small to tell. With the constant within +-z
        that speaks most for sound sensors.
    late_s : float
        Delay of the motion sensor, the same; NaN as long as the roll is too small to tell.
    sign_gain : float
        Gain below which a sign is wrong.
    obeyed : bool
        Whether roll or level gain is now of a size that no zeros of wrong sensors explain.
    settled : bool
        Whether the filters have forgotten their start, the first one or that after a gap.
    """

    def __init__(
        self,
        ship: RollShip,
        tank: Tank,
        thresholds: MonitorThresholds,
        period_s: float,
        *,
        valve: bool = False,
    ) -> None:
        share = VALVE_SHARE if valve else LEAST_SHARE
        self._pump_share = share * share
        self.sign_gain = VALVE_SIGN_GAIN if valve else SIGN_GAIN
        mass, _, stiffness = coupled_matrices(ship, tank)
        density = tank.density_kg_m3
        water_kg_m = density * tank.reservoir_area_m2
        self._density = density
        self._inertia = float(mass[1, 1] / water_kg_m)
        self._slope = SlopePush(ship, tank, period_s)
        self._sway = most_sway(ship) / 2
        self._loss = tank.loss_pa_per_m_s / density
        self._quadratic_loss = tank.quadratic_loss_pa_per_m2_s2 / density
        self._stiffness = float(stiffness[1, 1] / water_kg_m)
        self._push = float(-stiffness[1, 0] / water_kg_m)
        self._push_inertia = float(-mass[1, 0] / water_kg_m)
        frequency_rad_s = tank.natural_frequency_rad_s
        self._push_at_w0 = roll_push_at_natural_frequency(ship, tank)
        self._most_m = FULL_SHARE * tank.level_limit_m
        self._level = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._roll = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._pump = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._held = DerivativeFilter(2 * frequency_rad_s, period_s) if valve else None
        self._settle = math.ceil(SETTLED / (2 * frequency_rad_s * period_s))
        self._keep = exp(-period_s / (MEMORY_PERIODS * thresholds.tank_period_s))
        self._late_keep = exp(-period_s / (LATE_PERIODS * thresholds.tank_period_s))
        # sums of so many squares of the least push
        roll, pump = thresholds.least_roll_push_m2_s2, thresholds.least_pump_push_m2_s2
        self._least_xx, self._least_pp = (x * x / (1 - self._keep) for x in (roll, pump))
        late_share = LATE_PUSHES * thresholds.least_roll_push_m2_s2 * frequency_rad_s
        self._least_dd = late_share * late_share / (1 - self._late_keep)
        self._zero = thresholds.zero_push_m2_s2
        self._still_rad = thresholds.roll_still_rad
        self._still_samples = round(STILL_PERIODS * thresholds.tank_period_s / period_s)
        self._most_unmoved = STILL_PUSHES * STILL_PUSHES * self._least_xx
        self._late_limit_s = thresholds.motion_late_s
        self._spike_m = thresholds.level_spike_m
        self._most_step_m = thresholds.level_most_m_s * period_s
        self._late_samples = round(thresholds.tank_period_s / period_s)
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._wait = -1
        self.settled = self.obeyed = False
        self._xx = self._pp = self._vv = self._rest_x = self._rest_p = 0.0
        self._both = self._level_both = 0.0
        self._uu = self._late_uu = 0.0
        self._slope.restart()
        self.slope_push = 0.0
        self._x = self._p = self._left = self._weight = 0.0
        self._forget_lead()
        self._still = 0
        self._roll_rad = math.inf
        self._unmoved = 0.0
        self.roll_gain = self.pump_gain = self.level_gain = self.late_s = math.nan

    def _forget_lead(self) -> None:
        """Begin anew with what leads the roll."""
        self._lead = self._d = self._dd = 0.0
        self._samples = 0

    def update(
        self,
        roll_rad: float,
        level_m: float,
        pressure_pa: float,
        steps: int = 1,
        held_pa: float = 0.0,
    ) -> int:
        """Take a sample of all three; return what was found.

        Between two samples that are some `steps` apart all three are taken to run straight. The
        pressure is that on the water, with what a valve holds back, `held_pa`, taken off.
        """
        held, push, held_m2_s2 = self._held, pressure_pa / self._density, held_pa / self._density
        if self._wait < 0:
            self._roll.start(roll_rad)
            self._level.start(level_m)
            self._pump.start(push)
            if held is not None:
                held.start(held_m2_s2)
            self._wait = self._settle
            return 0
        found = 0
        level, roll, pump = self._level, self._roll, self._pump
        if abs(level_m - level.last) > self._spike_m + steps * self._most_step_m:
            self._forget_lead()  # gauges that jumped say nothing of the motion sensor
        for left in range(steps, 0, -1):
            if held is not None:
                held.update(held.last + (held_m2_s2 - held.last) / left)
            found = self._take(
                roll.last + (roll_rad - roll.last) / left,
                level.last + (level_m - level.last) / left,
                pump.last + (push - pump.last) / left,
            )
            if self._wait < 0:  # the tank was too full to be judged
                break
        return found

    def _take(self, roll_rad: float, level_m: float, pump_m2_s2: float) -> int:
        level, roll = self._level, self._roll
        level_m_s2 = level.update(level_m)
        roll_rad_s2 = roll.update(roll_rad)
        self._pump.update(pump_m2_s2)
        p = self._pump.value
        x = self._push * roll.value + self._push_inertia * roll_rad_s2
        push = p + x
        self.slope_push = u = self._slope.update(roll, roll_rad_s2, level.value, level_m_s2)
        if self._wait > 0:
            self._wait -= 1
            self.settled = self.settled or self._wait == 0
            return 0
        if abs(level_m) > self._most_m:
            self.restart()  # what is not seen now is not known
            return 0
        rate_m_s = level.rate
        loss = self._loss + self._quadratic_loss * abs(rate_m_s)
        y = self._inertia * level_m_s2 + loss * rate_m_s + self._stiffness * level.value
        y += self._sway * u  # and no more than as much is left of it, either way
        keep = self._keep
        self._xx = xx = keep * self._xx + x * x
        self._pp = pp = keep * self._pp + p * p
        self._rest_x = keep * self._rest_x + (y - p) * x
        self._rest_p = keep * self._rest_p + (y - x) * p
        if self._held is not None:
            self._vv = keep * self._vv + self._held.value * self._held.value
        self._both = both = keep * self._both + push * push
        self._level_both = keep * self._level_both + y * push
        left = y - push
        self._x = keep * self._x + x
        self._p = keep * self._p + p
        self._left = keep * self._left + left
        self._weight = keep * self._weight + 1.0
        self._uu = keep * self._uu + u * u
        self._late_uu = self._late_keep * self._late_uu + u * u
        d = self._push_at_w0 * roll.rate
        self._lead = self._late_keep * self._lead + left * d
        self._d = self._late_keep * self._d + d
        self._dd = dd = self._late_keep * self._dd + d * d
        self._samples += 1
        self._still += 1
        if abs(roll_rad - self._roll_rad) > self._still_rad:
            self._roll_rad = roll_rad
            self._still = 0
        self._unmoved = keep * self._unmoved + left * left
        return self._judge(xx, pp, both, dd)

    def _judge(self, xx: float, pp: float, both: float, dd: float) -> int:
        found = 0
        self.obeyed = False
        zero, sway = self._zero, self._sway * math.sqrt(self._uu)
        self.roll_gain = self.pump_gain = self.level_gain = self.late_s = math.nan
        held = LEAST_SHARE * LEAST_SHARE * pp + HELD_SHARE * HELD_SHARE * self._vv
        if xx > self._least_xx and xx > held:
            feigned = zero * abs(self._x) + sway * math.sqrt(xx)
            self.roll_gain = gain = (self._rest_x + feigned) / xx
            self.obeyed = self._rest_x - feigned > STUCK_GAIN * xx
            if gain < self.sign_gain:
                found = _WATER_SIGN
        if pp > self._least_pp and pp > self._pump_share * xx:
            feigned = zero * abs(self._p) + sway * math.sqrt(pp)
            self.pump_gain = gain = (self._rest_p + feigned) / pp
            if gain < self.sign_gain:
                found |= _PUMP_SIGN
        if both > self._least_xx + self._least_pp:
            feigned = zero * abs(self._x + self._p) + sway * math.sqrt(both)
            self.level_gain = gain = (self._level_both + feigned) / both
            self.obeyed = self.obeyed or self._level_both - feigned > STUCK_GAIN * both
            if gain < self.sign_gain:
                found |= _WATER_SIGN
            elif gain < STUCK_GAIN:
                found |= _LEVEL_STUCK
        if self._still > self._still_samples:
            weight = self._weight
            mean = within(self._left / weight, zero)
            unmoved = self._unmoved + mean * (weight * mean - 2 * self._left)
            most = math.sqrt(self._most_unmoved) + sway
            if unmoved > most * most:
                found |= _ROLL_STUCK
        if dd > self._least_dd and self._samples > self._late_samples:
            feigned = zero * abs(self._d) + self._sway * math.sqrt(self._late_uu * dd)
            self.late_s = late_s = (self._lead - feigned) / dd
            if late_s > self._late_limit_s:
                found |= _LATE
        return found
