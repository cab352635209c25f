"""The passive twin: what the ship would roll in these waves without the pump.

Ship and twin feel the same wave moment K, the twin no pressure. With the state x of the ship and
x_t of the twin, M the model of roll and tank, f what is not linear in it::

    x'   = M x   + b P + f(x)   + e K
    x_t' = M x_t       + f(x_t) + e K

so the wave moment need not be known: what the pump has done, d = x - x_t, obeys ::

    d'   = M d   + b P + f(x) - f(x - d)

and the twin's roll is the measured roll minus that of d. A wave moment estimated from the same
model and fed to the passive ship gives the same answer, by superposition, and adds the estimator's
lag. f holds the ship's quadratic damping and what its restoring moment has beyond its linear part,
and the tank's quadratic loss.

The twin's model is the configuration's ship. A ship that was loaded otherwise makes d wrong by as
much as its answer to the pump differs, and nothing where the pump does nothing.

The twin has its valve open. What the valve takes beyond that from the water acts on the ship as the
pump does, with the sign turned. Its loss is known by half, so a ship with a valve is compared with
more room.
"""

import math
from typing import Final

import numpy as np

from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.dynamics.ship import RollShip, restoring
from utank_hil.dynamics.tank import Tank

MEMORY_PERIODS: Final = 6.0
"""Roll periods in the running root mean squares."""
MEAN_PERIODS: Final = 6.0
"""Roll periods in the mean roll, about which they are taken."""
AMPLIFIED: Final = 1.25
RECOVERED: Final = 1.05
"""Own roll over the twin's at which a law has lost, and at which that is over."""
UNKNOWN: Final = 1.0
"""So much more at the start, when nothing is remembered: over their first roll period sound laws
rolled a ship 1.63 times as much, over the first five 1.5 times."""
RECORD_PERIODS: Final = 36.0
RECORD: Final = 1.1
"""Own roll over the twin's that a law has lost by over so many roll periods, too. A lull may last
minutes: GPC, which takes half of the roll off on the day of the storm, came to 1.38 over six
periods there, to 1.25 over twelve and to 1.06 over these."""
GROSS: Final = 1.6
"""Own roll over the twin's over six periods at which a law has lost whatever its record."""
MOST_MADE_RAD: Final = 1.0
"""Roll that no pump makes: a pressure was wrong, and the comparison begins anew."""
DECAY_PERIODS: Final = 6.0
"""Roll periods in which roll that was made on purpose decays, before it is forgotten."""
ANEW_PERIODS: Final = 2.0
"""Roll periods that are remembered before the next judgement: the pump makes its roll from the
beginning, and in a lull of half a period a sound law came to 2.45 times the twin's."""
LASTS_PERIODS: Final = 0.25
"""The memory of the mean squares is the patience: longer, and a bad law only rolls it longer."""


class PassiveTwin:
    """The twin and the comparison with it, updated every `period_s`.

    Below the own root mean square `least_roll_rad` nothing is judged. `open_loss` is that of the
    tank's valve, fully open, in Pa per (m/s)^2 of the level's rate. `room` is the factor on the
    ratios of own roll to the twin's at which a law has lost.
    """

    def __init__(
        self,
        ship: RollShip,
        tank: Tank,
        period_s: float,
        least_roll_rad: float,
        open_loss: float = 0.0,
        *,
        room: float = 1.0,
    ) -> None:
        self._period_s = period_s
        self._amplified, self._record = room * AMPLIFIED, room * RECORD
        self._gross = room * GROSS
        self._open_loss = open_loss
        self._made = np.zeros(7)
        self._effort = self._made[4:]
        self.take(ship, tank)
        roll_period_s = 2 * math.pi / tank.natural_frequency_rad_s
        self._share = period_s / (MEMORY_PERIODS * roll_period_s)
        self._mean_share = period_s / (MEAN_PERIODS * roll_period_s)
        self._patience_s = LASTS_PERIODS * roll_period_s
        self._decay_s = DECAY_PERIODS * roll_period_s
        self._anew_s = ANEW_PERIODS * roll_period_s
        self._least_power = least_roll_rad * least_roll_rad
        self._pressure_pa = 0.0
        self._mean_rad = self._twin_mean_rad = 0.0
        self._record_share = period_s / (RECORD_PERIODS * roll_period_s)
        self._forget()
        self._losing_s = 0.0
        self.roll_rad = 0.0  #: The twin's roll.
        #: Whether the ship has rolled more than its twin for over a quarter of a roll period.
        self.amplified = False

    def take(self, ship: RollShip, tank: Tank) -> None:
        """Be the twin of another ship and tank from now on; what the pump has made stays."""
        a, b = state_matrices(ship, tank)
        # pressure, moment on the ship, force on the water as a pressure
        transition, step = transition_and_step(a, np.column_stack([b, b[:, 0]]), self._period_s)
        self._step = np.hstack([transition, step])
        self._damping = ship.quadratic_damping_nms2_rad2
        self._loss = tank.quadratic_loss_pa_per_m2_s2 + self._open_loss
        moment = restoring(ship)
        self._stiffness = ship.stiffness_nm_rad
        self._piece_rad = moment.piece_rad
        # highest power first
        self._pieces = [tuple(row[::-1]) for row in moment.coefficients_nm.tolist()]
        self._straight = not (ship.gz_m or any(ship.restoring_odd_nm))

    @property
    def ship_rms_rad(self) -> float:
        """Root mean square of the ship's roll about its mean, over some roll periods."""
        return math.sqrt(self._power)

    @property
    def rms_rad(self) -> float:
        """The same of the twin's."""
        return math.sqrt(self._twin_power)

    @property
    def share(self) -> float:
        """How near the comparison is to its threshold, 1; NaN where nothing is judged."""
        if self._losing_s < 0 or self._power <= self._least_power or not self._twin_power:
            return math.nan
        lately = math.sqrt(self._power / self._twin_power)
        record = math.sqrt(self._record_power / self._twin_record_power) / self._record
        lost = min(lately / (self._amplified + self._unknown), record)
        return max(lost, lately / (self._gross + self._unknown))

    def update(
        self,
        roll_rad: float,
        rate_rad_s: float,
        level_rate_m_s: float,
        pressure_pa: float,
        *,
        counts: bool = True,
    ) -> None:
        """Take what is measured, once a period.

        `pressure_pa` is that across the pump, less what the valve takes beyond an open one.
        `counts` says whether the roll is to be trusted; else nothing of it is remembered, or
        judged.
        """
        made, effort = self._made, self._effort
        effort[0] = 0.5 * (pressure_pa + self._pressure_pa)
        self._pressure_pa = pressure_pa
        effort[1] = self._moment_beside_nm(roll_rad, rate_rad_s)
        other = level_rate_m_s - float(made[3])
        effort[2] = -self._loss * (abs(level_rate_m_s) * level_rate_m_s - abs(other) * other)
        made[:4] = product(self._step, made)
        if not abs(float(made[0])) < MOST_MADE_RAD:  # pragma: no mutate: it is never just that
            made[:] = 0.0
            self.excuse()
        self.roll_rad = twin_rad = roll_rad - float(made[0])
        if not counts:
            return
        self._mean_rad += self._mean_share * (roll_rad - self._mean_rad)
        self._twin_mean_rad += self._mean_share * (twin_rad - self._twin_mean_rad)
        own_rad, twin_rad = roll_rad - self._mean_rad, twin_rad - self._twin_mean_rad
        own_power, twin_power = own_rad * own_rad, twin_rad * twin_rad
        self._power += self._share * (own_power - self._power)
        self._twin_power += self._share * (twin_power - self._twin_power)
        self._record_power += self._record_share * (own_power - self._record_power)
        self._twin_record_power += self._record_share * (twin_power - self._twin_record_power)
        self._judge()

    def excuse(self) -> None:
        """Roll that is caused on purpose: forgotten when it has decayed, and judged anew then."""
        self._losing_s = -self._decay_s - self._anew_s
        self.amplified = False

    def _forget(self) -> None:
        self._power = self._twin_power = 0.0
        self._record_power = self._twin_record_power = 0.0
        self._unknown = UNKNOWN

    def _judge(self) -> None:
        self._unknown -= self._share * self._unknown
        if self._losing_s < 0:
            before_s, self._losing_s = self._losing_s, min(self._losing_s + self._period_s, 0.0)
            if before_s < -self._anew_s <= self._losing_s:  # pragma: no mutate: never just that
                self._forget()
            return
        ratio = RECOVERED if self.amplified else self._amplified + self._unknown
        least_power = max(self._least_power, ratio * ratio * self._twin_power)
        record_power = self._record * self._record * self._twin_record_power
        gross = self._gross + self._unknown
        on_record = (
            self.amplified
            # pragma: no mutate start: it is never just that
            or self._record_power > record_power
            or self._power > gross * gross * self._twin_power
            # pragma: no mutate end
        )
        if on_record and self._power > least_power:
            self._losing_s += self._period_s
        else:
            self._losing_s = 0.0
        self.amplified = self._losing_s > self._patience_s  # pragma: no mutate: never just that

    def _moment_beside_nm(self, roll_rad: float, rate_rad_s: float) -> float:
        """Moment on the ship that is not linear, less that on the twin."""
        made_rad, made_rad_s = float(self._made[0]), float(self._made[1])
        other_rad_s = rate_rad_s - made_rad_s
        moment_nm = -self._damping * (abs(rate_rad_s) * rate_rad_s - abs(other_rad_s) * other_rad_s)
        if self._straight:  # pragma: no mutate: else rounding is left
            return moment_nm
        righting_nm = self._righting_nm(roll_rad) - self._righting_nm(roll_rad - made_rad)
        return moment_nm - righting_nm + self._stiffness * made_rad

    def _righting_nm(self, roll_rad: float) -> float:
        since = heel = abs(roll_rad)
        piece = self._pieces[0]
        if heel > self._piece_rad:  # pragma: no mutate: both pieces meet there
            last = len(self._pieces) - 1  # pragma: no mutate: the last two are one polynomial
            index = min(int(heel / self._piece_rad), last)
            piece, since = self._pieces[index], heel - index * self._piece_rad
        value = 0.0
        for coefficient in piece:
            value = value * since + coefficient
        return value if roll_rad >= 0 else -value  # pragma: no mutate: at zero it is zero
