"""The tank's own equation: whether the water moves as roll and pressure push it.

With the level h, the roll phi and the pump's pressure P, thesis (2.19) per mass of water is ::

    Le h'' + (c + q |h'|) h' + 2 g h  =  P / rho  +  g L phi + L (H + Lz) phi''
              y, what the water shows      p                 x

A ship that sways takes k u from the right side, with u = L g times the slope of the waves, as the
moment that rolls the ship tells it, and k from 0 to `most_sway`, nearly constant (`SlopePush`).
All are low-pass filtered alike, with both poles at 2 w0, which gives the derivatives without
differentiating. Of a ship with hull data all pass `Band`, too, which keeps what swings at w0 and
leaves little from 1.6 w0 on: there the moment that rolls a wide hull vanishes and turns its sign,
and the sway does not. Sums with a memory of 0.4 roll periods tell what each of five cases leaves::

    sound            y - p - x + k u
    motion reversed  y - p + x + k u'       u' by the reversed roll
    gauges swapped  -y - p - x - k u'       the levels are reversed instead
    pump reversed    y + p - x + k u
    roll late        y - p - x+ + k u      x+ a quarter of the tank's period ahead of x

with the k, and the constant within +-z, that leave the least: no sensor's zero is quite right, and
none measures the acceleration in a turn. A sign is wrong if the sound case leaves far more of the
push in question than another one does. For water that answers a push with the gain g, that is g
below `SIGN_GAIN`. So one k and one z have to explain all of the last half period, in phase with the
slope: reversed signs would take a negative one, or one that changes with the frequency.

The level's gain, that of y's deviation from its mean on that of p + x, is 0 if the level is stuck.
What leads y - p - x the measured roll tells the motion sensor's delay, over 1.5 roll periods. Both
hold for every k. Where the roll has not moved for a quarter of a period, what the sound case leaves
tells that it should have.

A turn that builds up is no constant, and heels the ship meanwhile. So delays and a roll that does
not move are judged by `Unsteady` signals, with the sensors' zeros alone.

The ship's inertia, stiffness and load stand in u alone. A case is judged only where its own
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
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import DerivativeFilter, most_pushes_of_noise
from utank_hil.safety.monitors.sway import SPREAD, SPREAD_OF_SHARE, Misfit, SlopePush, most_sway
from utank_hil.safety.monitors.thresholds import MonitorThresholds

SIGN_GAIN: Final = -0.25
VALVE_SIGN_GAIN: Final = -0.5
"""The same behind a valve: one that holds back half as much again as configured makes it -0.23."""
RATE_LEFT: Final = 1.25
"""What the filters leave of |h'| h' over what they leave of h', squared, near w0."""
SETTLED: Final = 6.0
BAND_SETTLED: Final = 8.5
"""Time constants of the first filters after which their start is forgotten to 2 %, and then the
band's, which until then holds short waves for steady ones: with 7 for both, 9 of 96 starts of sound
ships of 180 to 330 m came to more than 0.8."""
BAND: Final = 1.3
BAND_RATIO: Final = 0.5
NOTCH: Final = 2.0
"""Over w0: pole and zero of `Band`. Chosen with its memory, what is unexplained and the spread,
among forty, by records of four hulls of 180 to 330 m: 0.8 at most of the threshold if sound."""
STUCK_GAIN: Final = 0.3
FILLED: Final = 0.25
"""Of the memory, before anything is judged: a moment of a slow wave is like a zero that is off."""
UNEXPLAINED: Final = 0.5
BAND_UNEXPLAINED: Final = 1.0
"""Of a push: what the model's errors may leave of it, without the band and with it."""
STILL_PERIODS: Final = 0.25
STILL_PUSHES: Final = 4.0
"""Of the least push, root mean square: so much must be left unexplained by a roll that is still."""
CREST_PERIODS: Final = 0.1
"""A level of 0.3 m stays within its noise for so long at a crest; a longer one has no sign."""
MEMORY_PERIODS: Final = 0.4
BAND_MEMORY_PERIODS: Final = 0.44
LATE_PERIODS: Final = 1.5
MEAN: Final = 0.5
"""Over w0: both poles of `Unsteady`. Of a push that grows to 1 within T, 0.15 are left at most."""
LATE_PUSHES: Final = 3.0
"""Of the least push. With 1.75, noise looked like a delay in healthy hours of calm sea, and with
2.2 a turn in still water did."""
LEAST_SHARE: Final = 0.06
"""Of one push beside the other one."""
VALVE_SHARE: Final = 0.2
"""Of the pump's push beside the roll's, where there is a valve."""
HELD_SHARE: Final = 0.3
"""Of the roll's push beside what a valve holds back."""
FULL_SHARE: Final = 0.9
"""Of the tank's height: beyond, roof and bottom push too."""


def roll_push_at_natural_frequency(ship: RollShip, tank: Tank) -> float:
    """Push on the water per roll that swings at w0, in m^2/(s^2 rad): x / phi."""
    mass, _, stiffness = coupled_matrices(ship, tank)
    frequency = tank.natural_frequency_rad_s
    push = mass[1, 0] * frequency * frequency - stiffness[1, 0]
    return float(push / (tank.density_kg_m3 * tank.reservoir_area_m2))


class Band:
    """Filters of some signals around w0: (1 + (s / n)^2) / ((s / b)^2 + s / b + 1)."""

    def __init__(self, frequency_rad_s: float, period_s: float, count: int) -> None:
        self._filters = tuple(
            DerivativeFilter(BAND * frequency_rad_s, period_s, BAND_RATIO) for _ in range(count)
        )
        self._share = 1 / (NOTCH * frequency_rad_s * NOTCH * frequency_rad_s)
        self.begun = False

    def update(self, signals: tuple[float, ...]) -> list[float]:
        """Take the next sample of each; the first one begins anew."""
        found, share = [], self._share
        for each, signal in zip(self._filters, signals, strict=True):
            if not self.begun:
                each.start(signal)
            bend = each.update(signal)
            found.append(each.value + share * bend)
        self.begun = True
        return found


class Unsteady:
    """What some signals have beside a mean, twice, scaled to as much as they have at w0."""

    def __init__(self, frequency_rad_s: float, period_s: float, count: int) -> None:
        self._share = 1 - exp(-MEAN * frequency_rad_s * period_s)
        self._scale = 1 + MEAN * MEAN
        self._first: list[float] = []
        self._second = [0.0] * count

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._first.clear()

    def update(self, signals: list[float]) -> list[float]:
        """Take the next sample of each; the first one is a mean."""
        first, second, share, found = self._first, self._second, self._share, []
        if not first:
            first[:], second[:] = signals, [0.0] * len(signals)
        for place, signal in enumerate(signals):
            first[place] += share * (signal - first[place])
            beside = signal - first[place]
            second[place] += share * (beside - second[place])
            found.append(self._scale * (beside - second[place]))
        return found


class TankEquation:
    """Gains of roll, pump and level in the tank's equation, updated every `period_s`.

    With `valve` the pressure holds what a valve takes, as it is estimated. `doubt` is the power
    over that at which a sign is found wrong. `level_gain`, see the module, and `late_s`, the motion
    sensor's delay, are with the constant within +-z and the sway that speak most for sound sensors.
    All three are NaN as long as the push, or the roll, is too small to tell. `obeyed` says whether
    reversed motion or swapped gauges now leave far more than sound sensors do, `suspect` whether
    they leave far less, if the ship does not turn. `water_moves` says whether the level moves as
    one that swings by more than its noise at w0.
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
        #: Gain below which a sign is wrong.
        self.sign_gain = VALVE_SIGN_GAIN if valve else SIGN_GAIN
        ratio = (1 - self.sign_gain) / (1 + self.sign_gain)
        self._clearly, self._far = ratio * ratio, 2 * math.sqrt(-self.sign_gain)
        mass, _, stiffness = coupled_matrices(ship, tank)
        density = tank.density_kg_m3
        water_kg_m = density * tank.reservoir_area_m2
        self._density = density
        self._inertia = float(mass[1, 1] / water_kg_m)
        self._slope = SlopePush(ship, tank, period_s)
        self._most_sway = most_sway(ship)
        self._spread = self._of_sway = SPREAD * self._most_sway
        self._loss = tank.loss_pa_per_m_s / density
        self._quadratic_loss = RATE_LEFT * tank.quadratic_loss_pa_per_m2_s2 / density
        self._stiffness = float(stiffness[1, 1] / water_kg_m)
        self._push = float(-stiffness[1, 0] / water_kg_m)
        self._push_inertia = float(-mass[1, 0] / water_kg_m)
        frequency_rad_s = tank.natural_frequency_rad_s
        self._w0 = frequency_rad_s
        self._push_at_w0 = roll_push_at_natural_frequency(ship, tank)
        self._most_m = FULL_SHARE * tank.level_limit_m
        self._level = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._roll = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._pump = DerivativeFilter(2 * frequency_rad_s, period_s)
        self._held = DerivativeFilter(2 * frequency_rad_s, period_s) if valve else None
        self._band: Band | None = None
        settled, memory = SETTLED, MEMORY_PERIODS
        self._unexplained, self._spread_of_share = UNEXPLAINED, 0.0
        if thresholds.of_hull:
            self._band = Band(frequency_rad_s, period_s, 7)
            settled, memory = BAND_SETTLED, BAND_MEMORY_PERIODS
            self._unexplained, self._spread_of_share = BAND_UNEXPLAINED, SPREAD_OF_SHARE
        self._settle = math.ceil(settled / (2 * frequency_rad_s * period_s))
        self._band_wait = math.ceil((settled - SETTLED) / (2 * frequency_rad_s * period_s))
        self._keep = exp(-period_s / (memory * thresholds.tank_period_s))
        self._unsteady = Unsteady(frequency_rad_s, period_s, 4)
        self._once, self._twice = (Unsteady(frequency_rad_s, period_s, 3) for _ in range(2))
        self._late_keep = exp(-period_s / (LATE_PERIODS * thresholds.tank_period_s))
        # sums of so many squares of the least push
        samples = memory * thresholds.tank_period_s / period_s
        like_roll, whole = most_pushes_of_noise(thresholds.gauge_push_m2_s2, samples)
        roll = max(thresholds.least_roll_push_m2_s2, like_roll)
        pump = thresholds.least_pump_push_m2_s2
        self._least_xx, self._least_pp = (x * x / (1 - self._keep) for x in (roll, pump))
        late_share = LATE_PUSHES * roll * frequency_rad_s
        self._least_dd = late_share * late_share / (1 - self._late_keep)
        self._filled = FILLED / (1 - self._keep)
        self._steady, self._zero = thresholds.steady_push_m2_s2, thresholds.zero_push_m2_s2
        self._still_rad = thresholds.roll_still_rad
        self._level_still_m = thresholds.level_still_m
        self._crest_samples = round(CREST_PERIODS * thresholds.tank_period_s / period_s)
        self._still_samples = round(STILL_PERIODS * thresholds.tank_period_s / period_s)
        self._most_unmoved = max(STILL_PUSHES * thresholds.least_roll_push_m2_s2, whole)
        self._late_limit_s = thresholds.motion_late_s
        self._spike_m = thresholds.level_spike_m
        self._most_step_m = thresholds.level_most_m_s * period_s
        self._late_samples = round(thresholds.tank_period_s / period_s)
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._wait = -1  # pragma: no mutate: below zero
        if self._band is not None:
            self._band.begun = False
        self.obeyed = self.suspect = self.water_moves = False
        self._sound, self._reversed, self._swapped, self._pump_reversed = (
            Misfit() for _ in range(4)
        )
        self._sound_unsteady, self._quarter_late = Misfit(), Misfit()
        # pragma: no mutate start: one more is little beside hundreds of samples
        self._xx = self._xx_unsteady = self._pp = self._vv = self._both = 0.0
        self._level_both = self._level_sum = self._push_sum = self._slope_both = 0.0
        self._slope_lead = self._late_uu = 0.0
        # pragma: no mutate end
        self._slope.restart()
        for each in (self._unsteady, self._once, self._twice):
            each.restart()
        self.slope_push = 0.0
        self._forget_lead()
        self._still = self._level_still = self._late = 0
        self._roll_rad = self._level_m = math.inf
        self.doubt = self.level_gain = self.late_s = math.nan

    @property
    def settled(self) -> bool:
        """Whether the filters have forgotten their start, the first one or that after a gap."""
        return self._wait == 0

    def _forget_lead(self) -> None:
        """Begin anew with what leads the roll."""
        self._lead = self._dd = 0.0
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
        self.water_moves = abs(level.rate) > self._level_still_m * self._w0
        of_roll, of_level = self._slope.update(roll, roll_rad_s2, level.value, level_m_s2)
        self.slope_push = of_roll + of_level
        if self._wait > self._band_wait:
            self._wait -= 1
            return 0
        rate_m_s = level.rate
        loss = self._loss + self._quadratic_loss * abs(rate_m_s)
        held = 0.0 if self._held is None else self._held.value
        y = self._inertia * level_m_s2 + loss * rate_m_s + self._stiffness * level.value
        p, x = self._pump.value, self._push * roll.value + self._push_inertia * roll_rad_s2
        d = rate = self._push_at_w0 * roll.rate
        lead = y - (p + x)
        if self._band is not None:
            y, p, x, d, of_roll, of_level, held = self._band.update(
                (y, p, x, rate, of_roll, of_level, held)
            )
        if self._wait > 0:
            self._wait -= 1
            return 0
        lead, rate, slope = self._twice.update(self._once.update([lead, rate, self.slope_push]))
        self._lead = self._late_keep * self._lead + lead * rate
        self._dd = self._late_keep * self._dd + rate * rate
        self._slope_lead = self._late_keep * self._slope_lead + slope * rate
        self._late_uu = self._late_keep * self._late_uu + slope * slope
        push, u = p + x, of_roll + of_level
        if abs(level_m) > self._most_m:
            self.restart()  # what is not seen now is not known
            return 0
        left, keep = y - push, self._keep
        self._sound.add(left, u, keep)
        self._reversed.add(left + 2 * x, of_level - of_roll, keep)
        self._swapped.add(left - 2 * y, of_roll - of_level, keep)
        self._pump_reversed.add(left + 2 * p, u, keep)
        self._xx = keep * self._xx + x * x
        self._pp = keep * self._pp + p * p
        self._vv = keep * self._vv + held * held
        self._both = keep * self._both + push * push
        self._level_both = keep * self._level_both + y * push
        self._level_sum = keep * self._level_sum + y
        self._push_sum = keep * self._push_sum + push
        self._slope_both = keep * self._slope_both + u * push
        left, x, d, u = self._unsteady.update([left, x, d, u])
        self._sound_unsteady.add(left, u, keep)
        self._quarter_late.add(left + x - d / self._w0, u, keep)
        self._xx_unsteady = keep * self._xx_unsteady + x * x
        self._samples += 1
        self._level_still += 1
        if abs(level_m - self._level_m) > self._level_still_m:
            self._level_m = level_m
            self._level_still = 0  # pragma: no mutate: a sample more or less
        self._still += 1
        if abs(roll_rad - self._roll_rad) > self._still_rad:
            self._roll_rad = roll_rad
            self._still = 0  # pragma: no mutate: the same
        return self._judge()

    def _judge(self) -> int:
        self.obeyed = self.suspect = False
        self.doubt = self.level_gain = self.late_s = math.nan
        if self._sound.weight < self._filled:
            return 0
        sound = self._sound.least(self._most_sway, self._steady)
        unsteady = self._sound_unsteady.least(self._most_sway, self._zero)
        self._of_sway = self._spread + self._spread_of_share * self._sound.share
        spread = self._of_sway * math.sqrt(self._sound.uu)
        found = self._judge_signs(sound, unsteady)
        if self._does_not_answer(spread) and not found & Finding.WATER_SIGN:
            found |= Finding.LEVEL_STUCK
        if self._still > self._still_samples:
            most = self._most_unmoved / math.sqrt(1 - self._keep) + spread
            if unsteady > most * most:
                found |= Finding.ROLL_STUCK
        self._late = self._late + 1 if self._is_late() else 0
        # gauges that stop make the roll look late at first
        if self._late > self._crest_samples >= self._level_still:
            found |= Finding.MOTION_LATE
        return found

    def _judge_signs(self, sound: float, unsteady: float) -> int:
        """Judge signs and a delay of a quarter of a period, by what the sound case leaves."""
        most_sway, xx, pp, both = self._most_sway, self._xx, self._pp, self._both
        steady, zero, late_xx = self._steady, self._zero, self._xx_unsteady
        held = LEAST_SHARE * LEAST_SHARE * pp + HELD_SHARE * HELD_SHARE * self._vv
        enough_x = xx > self._least_xx and xx > held
        enough_late = late_xx > self._least_xx and late_xx > held
        enough_late = enough_late and self._samples > self._late_samples
        enough_p = pp > self._least_pp and pp > self._pump_share * xx
        enough_both = both > self._least_xx + self._least_pp
        cases = (
            (self._reversed, steady, sound, xx, enough_x, Finding.WATER_SIGN),
            (self._pump_reversed, steady, sound, pp, enough_p, Finding.PUMP_SIGN),
            (self._swapped, steady, sound, both, enough_both, Finding.WATER_SIGN),
            (self._quarter_late, zero, unsteady, late_xx, enough_late, Finding.MOTION_LATE),
        )
        judged = [
            (case.least(most_sway, most_zero), left, power, case.uu, finding)
            for case, most_zero, left, power, enough, finding in cases
            if enough
        ]
        found, most_uu = 0, self._sound.uu
        # a part of a wave tells less: as an average of as many samples
        filled = math.sqrt(self._sound.weight * (1 - self._keep))
        best = min([other for other, *_ in judged], default=0.0)
        for other, left, power, uu, finding in sorted(judged, reverse=True):
            least_uu = most_uu if self._band is None else min(uu, most_uu)
            doubt = filled * self._excess(left, other, power, least_uu)
            late = finding == Finding.MOTION_LATE
            clearly = 1.0 if late else self._clearly
            # a level that stops looks late in half the time
            moves = self._level_still <= self._crest_samples // (2 if late else 1)
            if moves and doubt > 1 and other <= clearly * best:
                found = found & Finding.MOTION_LATE | finding  # of two signs that which leaves less
            self.doubt = max(doubt, self.doubt)  # of NaN it is the first one
        # with a turn allowed for, a part of a wave looks like one of the other sign
        straight = self._sound.least(most_sway, zero)
        for case, _, _, power, enough, finding in cases:
            if enough and finding == Finding.WATER_SIGN:
                other = case.least(most_sway, zero)
                self.obeyed = self.obeyed or self._excess(other, straight, power, case.uu) > 1
                self.suspect = self.suspect or self._excess(straight, other, power, most_uu) > 1
        return found

    def _does_not_answer(self, spread: float) -> bool:
        """Whether the level does not answer the push; `spread` is what sway may leave."""
        mean = self._push_sum / self._sound.weight
        both = self._both - mean * self._push_sum
        if not both > self._least_xx + self._least_pp:
            return False
        slope_both = self._slope_both - mean * self._sound.u
        feigned = spread * math.sqrt(both) + max(self._most_sway * slope_both, 0.0)
        self.level_gain = (self._level_both - mean * self._level_sum + feigned) / both
        return self.level_gain < STUCK_GAIN

    def _is_late(self) -> bool:
        """Whether the water leads the roll by more than it may."""
        dd = self._dd
        if not (dd > self._least_dd and self._samples > self._late_samples):
            return False
        feigned = self._spread * math.sqrt(self._late_uu * dd)
        feigned -= min(self._most_sway * self._slope_lead, 0.0)
        self.late_s = (self._lead - feigned) / dd
        return self.late_s > self._late_limit_s

    def _excess(self, worse: float, better: float, power: float, uu: float) -> float:
        """Return how far one case leaves more than another, which has the true signs from 1 on.

        The difference is judged, in which what jumps or is wrong otherwise cancels, and the ratio,
        which tells the cases apart in long waves, where sway may hide most of the difference.
        """
        push, spread = math.sqrt(power), self._of_sway * math.sqrt(uu)
        far, near = self._far * push + spread, self._unexplained * push + spread
        ratio = worse / max(self._clearly * better, 1e-30)
        return max((worse - better) / (far * far), min(ratio, worse / (near * near)))
