"""The drive: whether the pressure follows the command, and how long it is held at a limit."""

import math
from typing import Final

from utank_hil.base.elementary import exp
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.thresholds import MonitorThresholds

LAGS_S: Final = 0.17
LOST_S: Final = 0.4
REVERSED_S: Final = 0.12
"""Two steps and more less than 300, 500 and 200 ms: a fault begins between two, and the model lags
behind the command."""
REVERSED_SHARE: Final = 1 / 3
"""Of the threshold: so much the other way is reversed."""
SETTLED_S: Final = 0.5
"""The drive is not judged before it has been enabled, or off, for so long: a rotor runs down."""
HASTY: Final = 3
"""Changes, each before the last had settled, from which on they are no excuse: an enable that
chatters."""
FULL_SHARE: Final = 0.98
HELD_S: Final = 10.0
STILL_SHARE: Final = 0.9
"""Of the degraded pressure: once found, less than that ends it, as no more is left then."""


class DriveFollowing:
    """The pressure against a model of the drive: the command, later by a step, through its lag.

    Of a drive that is off none is expected but what the water makes of a rotor that turns freely.

    A drive that says it is limited in power or speed may stay behind the command. It may oppose it
    only at its greatest speed, while the water flows the way of the command: the rotor brakes water
    that outruns it. Limited in power alone the motor still drives the rotor the way of the command,
    and water that outruns it soon has it at its greatest speed.

    `lag_s` is the pressure's time constant, `period_s` the time between two updates; `expected_pa`
    is the model's pressure, `late_pa` how far the measured one is off, where that is judged.
    """

    def __init__(self, lag_s: float, thresholds: MonitorThresholds, period_s: float) -> None:
        self._share = 1 - exp(-period_s / lag_s) if lag_s > 0 else 1.0
        self._limit_pa = thresholds.pressure_error_pa
        self._free_pa_m = thresholds.free_rotor_pa_m
        self._period_s = period_s
        self._enabled = False
        self._same_s = 0.0
        self._hasty = 0
        self._begin()

    def _begin(self) -> None:
        self.expected_pa = self.late_pa = self._command_pa = 0.0
        self._settled_s = self._behind_s = self._reversed_s = 0.0
        self._found = 0

    def update(
        self,
        command_pa: float,
        pressure_pa: float,
        level_m: float,
        level_rate_m_s: float,
        *,
        enabled: bool,
        limited: bool,
        at_speed: bool,
    ) -> int:
        """Take the command that leaves now and the newest pressure; return what was found.

        A pressure that is NaN, of a sensor that is late, changes nothing of what is found: one that
        is late again and again is judged by what it sends in between. `level_m` and its rate are
        those of the starboard side: how far the water is off, and the way it flows. `enabled` says
        whether the drive is in operation enabled, `limited` whether it says that its power or its
        speed is at the limit, `at_speed` whether that may be its speed.
        """
        if enabled is not self._enabled:
            self._enabled = enabled
            self._hasty = self._hasty + 1 if self._same_s < SETTLED_S else 0
            self._same_s = 0.0
            if self._hasty < HASTY:
                self._begin()
        self._same_s += self._period_s
        limit_pa = self._limit_pa
        if enabled:
            self.expected_pa += self._share * (self._command_pa - self.expected_pa)
            self._command_pa = command_pa
        else:
            self.expected_pa = self._command_pa = 0.0
            limit_pa += self._free_pa_m * abs(level_m)
        self._settled_s += self._period_s
        if self._settled_s >= SETTLED_S and pressure_pa == pressure_pa:
            outrun = at_speed and level_rate_m_s * self.expected_pa > 0
            self._found = self._judge(pressure_pa, limit_pa, limited=limited, outrun=outrun)
        return self._found

    def _judge(self, pressure_pa: float, limit_pa: float, *, limited: bool, outrun: bool) -> int:
        expected_pa = self.expected_pa
        # pragma: no mutate start: of zero both ways count alike
        along_pa = pressure_pa if expected_pa > 0 else -pressure_pa
        # pragma: no mutate end
        if abs(expected_pa) > limit_pa and along_pa < -REVERSED_SHARE * limit_pa and not outrun:
            self._reversed_s += self._period_s
        else:
            self._reversed_s = 0.0
        ahead_pa = abs(expected_pa) + limit_pa
        excused = limited and (outrun or along_pa > -limit_pa) and along_pa < ahead_pa
        self.late_pa = 0.0 if excused else abs(pressure_pa - expected_pa)
        if self.late_pa > limit_pa:
            self._behind_s += self._period_s
        else:
            self._behind_s = 0.0
            return 0
        found = Finding.PUMP_SIGN if self._reversed_s > REVERSED_S else 0
        if self._behind_s > LOST_S:
            return found | Finding.DRIVE_LAGS | Finding.DRIVE_LOST
        return found | Finding.DRIVE_LAGS if self._behind_s > LAGS_S else found


class Saturation:
    """How long the command is held at its limit on one side, or the drive at one of its own.

    A limit of the drive excuses a pressure that stays behind (`DriveFollowing`), so whatever the
    command's side, it may not last.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._limit_pa = thresholds.pressure_limit_pa
        self._still_share = STILL_SHARE * thresholds.degraded_share
        self._side = 0.0
        self._held_s = self._limited_s = 0.0
        self._found = False  # pragma: no mutate: the first update only tells the side

    def update(self, command_pa: float, *, drive_limited: bool, elapsed_s: float) -> int:
        """Take the command; return what was found."""
        share = self._still_share if self._found else FULL_SHARE
        held = drive_limited or abs(command_pa) >= share * self._limit_pa
        side = math.copysign(1.0, command_pa)  # pragma: no mutate: its sign alone counts
        if held and side == self._side:
            self._held_s += elapsed_s
        else:
            self._held_s = 0.0
        self._side = side
        self._limited_s = self._limited_s + elapsed_s if drive_limited else 0.0
        self._found = self._held_s > HELD_S or self._limited_s > HELD_S
        return Finding.SATURATED if self._found else 0
