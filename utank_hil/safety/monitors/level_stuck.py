"""A level that stands still although it is pushed, and the sum of both, which stays zero.

While the measured level stays within a band, the water is computed from where it began, at rest, by
the tank's equation. Water that does move may cross the band to its turning point and back; in that
time the computed level moves four bands, and some more by the noise. Sixteen are a level that is
stuck, if they are as many with every sway that the ship may have and with every constant push, of
a turn and of the sensors' zeros, that would have held it still until then. A level that repeats
itself to the last digit for as long as a live gauge does not needs no such push to be excluded.
"""

import math
from typing import Final

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import DEAD_PERIODS, DEAD_S
from utank_hil.safety.monitors.noise import Noise
from utank_hil.safety.monitors.sway import most_sway
from utank_hil.safety.monitors.tank_equation import roll_push_at_natural_frequency
from utank_hil.safety.monitors.thresholds import STILL, MonitorThresholds

SMOOTH_S: Final = 2.0
LASTS_S: Final = 30.0
LARGE: Final = 3.0
"""So many times the threshold: no longer a drift to live with."""


class Volume:
    """Sum of both levels, which mirror one another, and the gauges' noise in it."""

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._limit_m = thresholds.volume_m
        self._noise = Noise(thresholds.level_noise_m)
        self._over_s = 0.0
        self.sum_m = math.nan  #: Sum of the levels, smoothed over two seconds.

    def update(self, port_m: float, starboard_m: float, elapsed_s: float) -> int:
        """Take both levels; return what was found."""
        if self.sum_m != self.sum_m:  # the first sample
            self.sum_m = port_m + starboard_m
        beside_m = port_m + starboard_m - self.sum_m
        self.sum_m += beside_m * (elapsed_s / SMOOTH_S)
        found = Finding.NOISE if self._noise.update(beside_m, elapsed_s) else 0
        over = abs(self.sum_m)
        if over <= self._limit_m:
            self._over_s = 0.0
            return found
        self._over_s += elapsed_s
        if self._over_s > LASTS_S or over > LARGE * self._limit_m:
            found |= Finding.VOLUME_LASTS
        return found | Finding.VOLUME


BANDS: Final = 16.0  #: Movement of the water that counts, in bands. Chosen; no study.
LEAST_STEADY_M: Final = 0.1 / (2 * GRAVITY_M_S2)
"""A tenth of where a push of 1 leads: at the start, and after a swing without loss, it is none."""


def way_until_found_m(level_noise_m: float) -> float:
    """Way of the water, out of the level's balance, from which a stuck level is found."""
    return BANDS * STILL * level_noise_m


class LevelStuck:
    """The measured level, looked at every `period_s`, against water that is free to move."""

    def __init__(
        self, ship: RollShip, tank: Tank, thresholds: MonitorThresholds, period_s: float
    ) -> None:
        water_kg_m = tank.density_kg_m3 * tank.reservoir_area_m2
        self._push = roll_push_at_natural_frequency(ship, tank)
        self._steady_push = float(-coupled_matrices(ship, tank)[2][1, 0] / water_kg_m)
        self._mean_share = period_s * tank.natural_frequency_rad_s / (2 * math.pi)
        self._mean_rad = 0.0
        self._density = tank.density_kg_m3
        self._most_sway = most_sway(ship)
        self._steady = thresholds.steady_push_m2_s2
        self._band_m = thresholds.level_still_m
        self._period_s = period_s
        self._dead_samples = math.ceil(
            max(DEAD_PERIODS * thresholds.tank_period_s, DEAD_S) / period_s
        )
        self._inertia = tank.effective_length_m
        self._loss = tank.loss_pa_per_m_s / tank.density_kg_m3
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._begin(math.inf)
        self._last_m, self._repeated = math.inf, 0

    def _begin(self, level_m: float) -> None:
        self._level_m = level_m
        self._moved_m = self._rate_m_s = 0.0
        self._swayed_m = self._sway_rate_m_s = 0.0
        self._steady_m = self._steady_rate_m_s = 0.0
        self._least, self._most = -self._steady, self._steady

    def update(
        self, roll_rad: float, level_m: float, pressure_pa: float, slope_push_m2_s2: float
    ) -> int:
        """Take what is measured, and what a sway may push (`SlopePush`); return what was found.

        Roll and pressure count as they are measured: the filters of the tank's equation delay them
        by more than the time in which moving water crosses the band.
        """
        # A steady heel pushes otherwise than a roll does.
        self._mean_rad += self._mean_share * (roll_rad - self._mean_rad)
        self._repeated = self._repeated + 1 if level_m == self._last_m else 0
        self._last_m = level_m
        if abs(level_m - self._level_m) > self._band_m:
            self._begin(level_m)
            return 0
        moved_m, rate_m_s = self._moved_m, self._rate_m_s
        pushed = self._push * (roll_rad - self._mean_rad) + self._steady_push * self._mean_rad
        pushed += pressure_pa / self._density - self._loss * rate_m_s
        pushed -= 2 * GRAVITY_M_S2 * (self._level_m + moved_m)
        self._rate_m_s = rate_m_s = rate_m_s + pushed / self._inertia * self._period_s
        self._moved_m = moved_m = moved_m + rate_m_s * self._period_s
        # what a sway of g times the slope takes from that
        swayed_m, rate_m_s = self._swayed_m, self._sway_rate_m_s
        pushed = slope_push_m2_s2 - self._loss * rate_m_s - 2 * GRAVITY_M_S2 * swayed_m
        self._sway_rate_m_s = rate_m_s = rate_m_s + pushed / self._inertia * self._period_s
        self._swayed_m = swayed_m = swayed_m + rate_m_s * self._period_s
        # what a constant push of 1 adds
        steady_m, rate_m_s = self._steady_m, self._steady_rate_m_s
        pushed = 1.0 - self._loss * rate_m_s - 2 * GRAVITY_M_S2 * steady_m
        self._steady_rate_m_s = rate_m_s = rate_m_s + pushed / self._inertia * self._period_s
        self._steady_m = steady_m = steady_m + rate_m_s * self._period_s
        # the constant pushes with which it has not moved further than this
        other_m, most_m = moved_m - self._most_sway * swayed_m, BANDS * self._band_m
        if steady_m > LEAST_STEADY_M:
            self._least = max(self._least, (-most_m - max(moved_m, other_m)) / steady_m)
            self._most = min(self._most, (most_m - min(moved_m, other_m)) / steady_m)
        if self._repeated > self._dead_samples:
            stuck = min(moved_m, other_m) > most_m or max(moved_m, other_m) < -most_m
        else:
            stuck = self._least > self._most
        return Finding.LEVEL_STUCK if stuck else 0
