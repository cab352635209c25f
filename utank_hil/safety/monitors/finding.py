"""What a monitor may find: one bit each, so that a tick hands all of them on as one number."""

from typing import Final


class Finding:
    """One bit a finding: plain numbers, since members of an enumeration take a tick too long."""

    ROLL_STUCK: Final = 1 << 0
    LEVEL_STUCK: Final = 1 << 1
    DRIFT: Final = 1 << 2
    DRIFT_LASTS: Final = 1 << 3
    WATER_SIGN: Final = 1 << 4
    PUMP_SIGN: Final = 1 << 5
    MOTION_LATE: Final = 1 << 6
    NOISE: Final = 1 << 7
    SPIKES: Final = 1 << 8
    VOLUME: Final = 1 << 9
    VOLUME_LASTS: Final = 1 << 10
    DRIVE_LAGS: Final = 1 << 11
    DRIVE_LOST: Final = 1 << 12
    SATURATED: Final = 1 << 13
    SECOND_SENDER: Final = 1 << 14
    NODE_SILENT: Final = 1 << 15
    FLOOD: Final = 1 << 16
    ROLL_AMPLIFIED: Final = 1 << 17
    SENSORS_DISAGREE: Final = 1 << 18
    DAMAGED: Final = 1 << 19
    FRAMES_LOST: Final = 1 << 20
    UNWATCHED: Final = 1 << 21
    UNWATCHED_LONG: Final = 1 << 22
    WRONG_PROOF: Final = 1 << 23
    VALVE_PASSES: Final = 1 << 24
    NOT_IN_HARBOUR: Final = 1 << 25
    HEEL_UNANSWERED: Final = 1 << 26
    HEEL_OVERDONE: Final = 1 << 27
    TANK_USED_UP: Final = 1 << 28
