"""The fault table: one row a fault.

The supervisor judges the conditions of these rows, `docs/safety.md` shows them, and
`utank-hil run` prints their words. The codes are those of `Fault`, of which each has one row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final, TypeAlias

from utank_hil.canbus.endpoints import BUCKET_LIMIT
from utank_hil.canbus.enumerations import Address, Fault
from utank_hil.runtime.observations import VALVE_OFF, Observations
from utank_hil.runtime.safety_limits import SafetyLimits

Judgement: TypeAlias = Callable[[Observations, SafetyLimits], bool]


class Reaction(Enum):
    """What a fault does, and with that when it is judged."""

    STOP = "zero pressure at once"
    """Judged while active and when arming begins, which it refuses; latched."""
    RAMP = "ramp to zero at the rate limit, cut after {zero_within_ms} ms"
    """As `STOP`, and judged after all of them."""
    HALVE = "half the pressure"
    """Judged while active; not latched."""
    REFUSE = "arming refused"
    """Judged when arming begins."""
    GIVE_UP = "arming given up"
    """Judged while the drive is being enabled."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One way in which a fault shows itself.

    Attributes
    ----------
    reaction : Reaction
    limit : str
        The condition in words; fields of `SafetyLimits` stand in braces.
    holds : callable
        Whether the condition is there.
    zero_within_ms : int
        With `Reaction.RAMP`, when the pressure is cut even if the ramp has not come to its end.
    awaited : int or None
        Place in the order in which the controller waits, in INIT, for conditions to go; None if
        it is ready all the same.
    """

    reaction: Reaction
    limit: str
    holds: Judgement
    zero_within_ms: int = 1000
    awaited: int | None = None


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One row of the fault table.

    Attributes
    ----------
    code : Fault
        As CTRL_STATUS carries it.
    happened, remedy : str
        For people: what happened, and what to do.
    conditions : tuple of Condition
    law_limit : str
        A law that ends at a limit of its own for this measurement (`StartsAnew.passed_limit`)
        shows this code; empty if none does.
    """

    code: Fault
    happened: str
    remedy: str
    conditions: tuple[Condition, ...]
    law_limit: str = ""


def _row(
    code: Fault, happened: str, remedy: str, *conditions: Condition, law_limit: str = ""
) -> FaultRow:
    return FaultRow(code, happened, remedy, conditions, law_limit)


# Of the conditions with the same reaction, the first that holds names the fault.
FAULTS: Final = (
    _row(
        Fault.BUS_LOST,
        "The CAN bus could not be read or written.",
        "Check the interface (ip -details link show), the cable and the termination.",
        Condition(
            Reaction.STOP,
            "error on sending or receiving within the last command cycle",
            lambda seen, _: seen.link_lost,
            awaited=1,
        ),
    ),
    _row(
        Fault.ADDRESS_CONFLICT,
        "Another node sends with the controller's address.",
        f"Stop the second sender of identifiers that end in {Address.CONTROLLER:X}, which may also "
        "be a test tool; then wait for ten seconds.",
        Condition(
            Reaction.STOP,
            "an identifier of the controller was received within 10 s, whatever came with it",
            lambda seen, _: seen.address_conflict,
            awaited=2,
        ),
    ),
    _row(
        Fault.VERSION_MISMATCH,
        "A node runs another message catalogue or another ship configuration.",
        "Compare the versions in the heartbeats; give all nodes the same catalogue and ship file.",
        Condition(
            Reaction.STOP,
            "a version in the heartbeats of drive, sensors or valve differs, or none was received",
            lambda seen, _: not seen.versions_match,
            awaited=8,
        ),
        Condition(
            Reaction.REFUSE,
            "a version in the panel's heartbeat differs, or none was received",
            lambda seen, _: not seen.panel_matches,
        ),
    ),
    _row(
        Fault.DRIVE_FAULT,
        "The pump drive reports a fault, or is not in operation enabled.",
        "Read the drive's fault in DRIVE_STATUS_2 and remove its cause.",
        Condition(
            Reaction.STOP,
            "drive reports a fault, or is out of operation enabled for over "
            "{drive_enabled_within_ms:g} ms",
            lambda seen, limits: (
                seen.drive_fault or seen.drive_out_ms > limits.drive_enabled_within_ms
            ),
        ),
        Condition(
            Reaction.GIVE_UP,
            "not in operation enabled within {arming_timeout_ms:g} ms of arming",
            lambda seen, limits: seen.arming_ms > limits.arming_timeout_ms,
        ),
    ),
    _row(
        Fault.DRIVE_SILENT,
        "The pump drive sends no status, or does not receive the commands.",
        "Check the drive's supply and bus connection. If DRIVE_STATUS_1 arrives but its command "
        "echo stands still, the drive does not accept PUMP_CMD.",
        Condition(
            Reaction.STOP,
            "status older than {drive_age_ms:g} ms, or no new command echo for over "
            "{echo_age_ms:g} ms",
            lambda seen, limits: (
                seen.drive_age_ms > limits.drive_age_ms or seen.echo_age_ms > limits.echo_age_ms
            ),
            awaited=6,
        ),
    ),
    _row(
        Fault.VALVE_SILENT,
        "The tank's valve sends no status, or does not receive the commands.",
        "Check the valve's supply and bus connection. If VALVE_STATUS arrives but its command echo "
        "stands still, the valve does not accept VALVE_CMD.",
        Condition(
            Reaction.STOP,
            "status older than {valve_age_ms:g} ms, or no new command echo for over "
            "{valve_echo_age_ms:g} ms",
            lambda seen, limits: (
                seen.valve_age_ms > limits.valve_age_ms
                or seen.valve_echo_age_ms > limits.valve_echo_age_ms
            ),
            awaited=7,
        ),
    ),
    _row(
        Fault.VALVE_FAULT,
        "The tank's valve reports a fault, or does not follow.",
        "Read the valve's fault in VALVE_STATUS and remove its cause.",
        Condition(
            Reaction.STOP,
            "valve reports a fault, or is not following for over {valve_follows_within_ms:g} ms",
            lambda seen, limits: (
                seen.valve_fault or seen.valve_out_ms > limits.valve_follows_within_ms
            ),
        ),
    ),
    _row(
        Fault.VALVE_NOT_FOLLOWING,
        "The tank's valve is not where it was told to be.",
        "Look for what blocks the valve; compare its time from shut to open with the ship file.",
        Condition(
            Reaction.STOP,
            f"more than {VALVE_OFF:.0%} of its way off for over {{valve_off_within_ms:g}} ms",
            lambda seen, limits: seen.valve_off_ms > limits.valve_off_within_ms,
        ),
    ),
    _row(
        Fault.INTERNAL,
        "The control law raised an error, or gave no finite pressure.",
        "Report it with the recording and the configuration; use another law until it is mended.",
        Condition(
            Reaction.STOP,
            "the law raises, or its answer is not finite",
            lambda seen, _: seen.law_failed,
        ),
    ),
    _row(
        Fault.LEVEL_LIMIT,
        "The water in a reservoir is too high, or a high-level switch is broken.",
        "If the water was low, check the switches and their wiring; if it was high, lower "
        "limits.level_m or limits.pressure_pa.",
        Condition(
            Reaction.STOP,
            "a high-level switch is closed, broken or not available",
            lambda seen, _: seen.high_level,
        ),
        law_limit="level_m",
    ),
    _row(
        Fault.BUS_OVERLOAD,
        "The CAN bus is nearly full.",
        "Find the node that sends too much (candump) and stop it.",
        Condition(
            Reaction.STOP,
            "over {bus_load_limit:.0%} of the bus in use over a second",
            lambda seen, limits: seen.bus_load > limits.bus_load_limit,
        ),
    ),
    _row(
        Fault.MOTION_SILENT,
        "No usable measurement comes from the motion sensor.",
        "Check the sensor's supply and bus connection, and the quality that SENSOR_MOTION carries.",
        Condition(
            Reaction.RAMP,
            "last good sample older than {motion_age_ms:g} ms",
            lambda seen, limits: seen.motion_age_ms > limits.motion_age_ms,
            zero_within_ms=200,  # 250 after the sample, whose first 30 ms of age are allowed
            awaited=3,
        ),
    ),
    _row(
        Fault.TANK_SILENT,
        "No usable measurement comes from the tank's level gauges.",
        "Check the gauges' supply and bus connection, and the quality that SENSOR_TANK carries.",
        Condition(
            Reaction.HALVE,
            "last good sample older than {tank_degraded_age_ms:g} ms",
            lambda seen, limits: seen.tank_age_ms > limits.tank_degraded_age_ms,
            awaited=4,
        ),
        Condition(
            Reaction.RAMP,
            "last good sample older than {tank_age_ms:g} ms",
            lambda seen, limits: seen.tank_age_ms > limits.tank_age_ms,
        ),
    ),
    _row(
        Fault.PUMP_SENSOR_SILENT,
        "No usable measurement comes from the pump's pressure sensor.",
        "Check the sensor's supply and bus connection, and the quality that SENSOR_PUMP carries.",
        Condition(
            Reaction.RAMP,
            "last good sample older than {pump_age_ms:g} ms",
            lambda seen, limits: seen.pump_age_ms > limits.pump_age_ms,
            awaited=5,
        ),
    ),
    _row(
        Fault.PROTECTION,
        "Messages of motion sensor, tank or drive keep arriving damaged or out of order.",
        "Look for a second sender of their identifiers, a node that protects them wrongly, and "
        "disturbance on the cable.",
        Condition(
            Reaction.RAMP,
            f"leaky bucket of rejected frames at {BUCKET_LIMIT}",
            lambda seen, _: not seen.protection_valid,
        ),
    ),
    _row(
        Fault.HEEL_LIMIT,
        "The ship rolls or heels beyond the limit for active control.",
        "Wait until the roll is small; correct the heel by ballast; check the motion sensor.",
        Condition(
            Reaction.RAMP,
            "roll over {roll_limit_rad:g} rad, or its mean over a minute over "
            "{heel_limit_rad:g} rad",
            lambda seen, limits: (
                abs(seen.roll_rad) > limits.roll_limit_rad
                or abs(seen.heel_rad) > limits.heel_limit_rad
            ),
        ),
        law_limit="roll_rad",
    ),
    _row(
        Fault.OVERRUN,
        "The controller's loop ran too late.",
        "Stop other work on the computer and give the controller real-time scheduling.",
        Condition(
            Reaction.STOP,
            "a tick over {long_overrun_ms:g} ms late",
            lambda seen, limits: seen.tick_late_ms > limits.long_overrun_ms,
        ),
        Condition(
            Reaction.RAMP,
            "{overruns_in_ten} of the last ten ticks late",
            lambda seen, limits: (
                limits.overruns_in_ten is not None
                and seen.overruns_in_ten >= limits.overruns_in_ten
            ),
        ),
    ),
    _row(
        Fault.OPERATOR_SILENT,
        "The operator's panel is not heard.",
        "Check that the panel runs and is connected to the bus.",
        Condition(
            Reaction.REFUSE,
            "silent for over {panel_age_to_arm_ms:g} ms",
            lambda seen, limits: seen.panel_age_ms > limits.panel_age_to_arm_ms,
        ),
        Condition(
            Reaction.RAMP,
            "silent for over {panel_age_armed_ms:g} ms",
            lambda seen, limits: seen.panel_age_ms > limits.panel_age_armed_ms,
        ),
    ),
)


def fault_text(fault: Fault) -> str:
    """Return the fault's name and, for people, what happened and what to do."""
    for row in FAULTS:
        if row.code == fault:
            return f"{fault.name}: {row.happened} {row.remedy}"
    return fault.name
