"""What a monitor may find: one bit each, so that a tick hands all of them on as one number."""

from enum import IntFlag, auto


class Finding(IntFlag):
    """One bit a finding."""

    ROLL_STUCK = auto()
    LEVEL_STUCK = auto()
    DRIFT = auto()
    DRIFT_LASTS = auto()
    WATER_SIGN = auto()
    PUMP_SIGN = auto()
    MOTION_LATE = auto()
    NOISE = auto()
    SPIKES = auto()
    VOLUME = auto()
    VOLUME_LASTS = auto()
    DRIVE_LAGS = auto()
    DRIVE_LOST = auto()
    SATURATED = auto()
    SECOND_SENDER = auto()
    NODE_SILENT = auto()
    FLOOD = auto()
    ROLL_AMPLIFIED = auto()
    SENSORS_DISAGREE = auto()
    DAMAGED = auto()
    FRAMES_LOST = auto()
    UNWATCHED = auto()
    UNWATCHED_LONG = auto()
