"""The fault table: one row a fault.

The supervisor judges the conditions of these rows, `docs/safety.md` shows them, and
`utank-hil run` prints their words. The codes are those of `Fault`, of which each has one row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Final, TypeAlias

from utank_hil.canbus.endpoints import BUCKET_LIMIT
from utank_hil.canbus.enumerations import Address, Fault
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.situation import THROTTLED_OFF, VALVE_OFF

if TYPE_CHECKING:  # who prints the words of a fault needs no ship
    from utank_hil.safety.safety_limits import SafetyLimits
    from utank_hil.safety.situation import Situation

ROLL_CALM_S: Final = 20
"""Half the roll period of a ship that rolls slowly, 40 s: from one greatest roll to the next."""

Holds: TypeAlias = "Callable[[Situation, SafetyLimits], bool]"


class Reaction(Enum):
    """What a fault does, and with that when it is judged."""

    STOP = "zero pressure at once"
    """Judged while active and when arming begins, which it refuses; latched."""
    RAMP = "ramp to zero at the rate limit, cut after {zero_within_ms} ms"
    """As `STOP`, and judged after all of them."""
    HALVE = "half the pressure"
    """Judged while active; not latched."""
    REFUSE = "arming refused"
    """Judged when arming begins and until ACTIVE; not latched."""
    GIVE_UP = "arming given up"
    """Judged while the drive is being enabled."""
    WARN = "none"
    """An alarm in every mode, and no more."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One way in which a fault shows itself."""

    reaction: Reaction
    limit: str  #: The condition in words; fields of `SafetyLimits` stand in braces.
    holds: Holds  #: Whether the condition is there.
    #: With `Reaction.RAMP`, when the pressure is cut even if the ramp has not come to its end.
    zero_within_ms: int = 1000
    #: Place in the order in which the controller waits, in INIT, for conditions to go; None if it
    #: is ready all the same.
    awaited: int | None = None
    findings: int = 0  #: Bits of `Finding`, any of which is this condition.
    #: With `Reaction.STOP`, whether it ends PASSIVE, too, where the drive is enabled.
    ends_passive: bool = False
    #: Whether it counts only where the drive is to be in operation enabled.
    of_drive_that_should_be_on: bool = False


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One row of the fault table."""

    code: Fault  #: Code in CTRL_STATUS.
    #: happened, remedy: for people: what happened, and what to do.
    happened: str
    remedy: str
    conditions: tuple[Condition, ...]


def _row(code: Fault, happened: str, remedy: str, *conditions: Condition) -> FaultRow:
    return FaultRow(code, happened, remedy, conditions)


def _found(
    reaction: Reaction, limit: str, findings: int, *, ends_passive: bool = False
) -> Condition:
    """What the monitors find."""
    return Condition(
        reaction,
        limit,
        lambda seen, _: seen.found & findings != 0,
        findings=findings,
        ends_passive=ends_passive,
    )


_STOP, _RAMP, _HALVE, _REFUSE, _GIVE_UP, _WARN = Reaction
# Of the conditions with the same reaction, the first that holds names the fault.
FAULTS: Final = (
    _row(Fault.HARDWIRED_STOP, "The hard-wired stop was pressed, or its loop is broken.",
         "Release the stop; if none is pressed, look for the break in the loop.",
         Condition(_STOP, "the stop loop is open, broken or not available, in any intact frame",
             lambda seen, _: seen.measured.hardwired_stop, ends_passive=True)),
    _row(Fault.HARDWIRED_SILENT, "The node of the hard-wired stop and high-level switches is not "
         "heard.",
         "Check the node's supply and bus connection, and the quality that it sends.",
         Condition(_STOP, "last good frame older than {hardwired_age_ms:g} ms",
             lambda seen, limits: seen.measured.hardwired_age_ms > limits.hardwired_age_ms,
             awaited=9)),
    _row(Fault.BUS_LOST, "The CAN bus could not be read or written.",
         "Check the interface (ip -details link show), the cable and the termination.",
         Condition(_STOP, "error on sending or receiving within the last command cycle",
             lambda seen, _: seen.measured.link_lost, awaited=1)),
    _row(Fault.ADDRESS_CONFLICT, "Another node sends with the controller's address.",
         f"Stop the second sender of identifiers that end in {Address.CONTROLLER:X}, which may "
         "also be a test tool; then wait for ten seconds.",
         Condition(_STOP, "an identifier of the controller was received within 10 s, whatever came "
             "with it", lambda seen, _: seen.measured.address_conflict, awaited=2)),
    _row(Fault.VERSION_MISMATCH, "A node runs another message catalogue or another ship "
         "configuration.",
         "Compare the versions in the heartbeats; give all nodes the same catalogue and ship file.",
         Condition(_STOP, "a version in the heartbeats of drive, sensors, valve or hard-wired "
             "inputs differs, or none was received for 5 s",
             lambda seen, _: not seen.measured.versions_match, awaited=8),
         Condition(_RAMP, "a version in the panel's heartbeat differs, or none was received",
             lambda seen, _: not seen.measured.panel_matches)),
    _row(Fault.DRIVE_FAULT, "The pump drive reports a fault, is not in operation enabled, or can't "
         "be switched off.",
         "Remove the cause of the fault that the drive tells. If it can't be switched "
         "off, cut its power (hard-wired stop, main switch).",
         Condition(_STOP, "drive reports a fault", lambda seen, _: seen.measured.drive_fault),
         Condition(_STOP, "drive out of operation enabled for over {drive_enabled_within_ms:g} ms, "
             "or from its third departure on (the count falls by one each second)",
             lambda seen, limits: seen.drive_out_ms > limits.drive_enabled_within_ms,
             of_drive_that_should_be_on=True),
         Condition(_STOP, "still in operation, or braking, 0.2 s after *disable voltage*",
             lambda seen, _: seen.own.drive_stays_on),
         Condition(_GIVE_UP, "not in operation enabled within {arming_timeout_ms:g} ms of arming",
             lambda seen, limits: seen.arming_ms > limits.arming_timeout_ms)),
    _row(Fault.DRIVE_SILENT, "The pump drive sends no status, or does not receive the commands in "
         "time.",
         "Check the drive's supply and bus connection. If its status arrives but its command "
         "echo stands still, the drive accepts no commands; if it is behind, look for what "
         "holds frames up, a gateway for example.",
         Condition(_STOP, "status older than {drive_age_ms:g} ms, or DRIVE_STATUS_2 never heard; "
             "no new command echo, at most three commands behind, for over {echo_age_ms:g} ms",
             lambda seen, limits: (seen.measured.drive_age_ms > limits.drive_age_ms
             or seen.own.echo_age_ms > limits.echo_age_ms), awaited=6)),
    _row(Fault.NODE_SILENT, "A device on the bus sends no heartbeat, or the drive no "
         "DRIVE_STATUS_2.",
         "Find the identifier that is missing on the bus (candump), and in docs/can-catalogue.md "
         "whose it is; check that device's supply, bus connection and firmware.",
         _found(_WARN, "DRIVE_STATUS_2 (TPDO2 of a CANopen drive, once it is configured), or a "
             "heartbeat of drive, sensors, valve or hard-wired inputs, silent for 1 s",
             Finding.NODE_SILENT)),
    _row(Fault.VALVE_SILENT, "The tank's valve sends no status, or does not receive the commands "
         "in time.",
         "Check the valve's supply and bus connection. If its status arrives but its command "
         "echo stands still, the valve accepts no commands; if it is behind, look for what "
         "holds frames up, a gateway for example.",
         Condition(_STOP, "status older than {valve_age_ms:g} ms, or no new command echo, at most "
             "three commands behind, for over {valve_echo_age_ms:g} ms", lambda seen, limits: (
             seen.own.valve.age_ms > limits.valve_age_ms
             or seen.own.valve.echo_age_ms > limits.valve_echo_age_ms), awaited=7)),
    _row(Fault.VALVE_FAULT, "The tank's valve reports a fault, or does not follow.",
         "Remove the cause of the fault that the valve tells.",
         Condition(_STOP, "valve reports a fault, or is not following for over "
             "{valve_follows_within_ms:g} ms", lambda seen, limits: (seen.own.valve.fault
             or seen.own.valve.out_ms > limits.valve_follows_within_ms))),
    _row(Fault.VALVE_NOT_FOLLOWING, "The tank's valve is not where it was commanded to be.",
         "Look for what blocks the valve, or keeps it from being tight; compare its time from shut "
         "to open with the ship file.",
         Condition(_STOP, f"more than {VALVE_OFF:.0%} of its way off, {THROTTLED_OFF:.0%} in heel "
             "removal, for over {valve_off_within_ms:g} ms",
             lambda seen, limits: seen.own.valve.off_ms > limits.valve_off_within_ms),
         _found(_STOP, "heel removal: more water passes the valve than its opening lets through, "
             "or any while it is shut", Finding.VALVE_PASSES)),
    _row(Fault.INTERNAL, "The control law raised an error, or gave no finite pressure.",
         "Report it with the recording and the configuration; use another law until it is mended.",
         Condition(_STOP, "the law raises, or its answer is not finite",
             lambda seen, _: seen.own.law_failed)),
    _row(Fault.LEVEL_LIMIT, "The water in a reservoir is too high, or a high-level switch is "
         "broken.",
         "If the water was low, check the switches and their wiring; if it was high, lower "
         "limits.level_m or limits.pressure_pa.",
         Condition(_STOP, "a high-level switch is closed, broken or not available",
             lambda seen, _: seen.measured.high_level)),
    _row(Fault.BUS_OVERLOAD, "The CAN bus is nearly full.",
         "Find the node that sends too much (candump) and stop it.",
         Condition(_STOP, "over {bus_load_limit:.0%} of the bus in use over a second",
             lambda seen, limits: seen.bus_load > limits.bus_load_limit)),
    _row(Fault.SIGN_FLIP, "The pump presses against its command, or its pressure is measured with "
         "the wrong sign.",
         "Check the pump's direction of rotation and the sign of the pressure sensor.",
         _found(_STOP, "measured pressure against the command for 200 ms, or against the water's "
             "motion", Finding.PUMP_SIGN, ends_passive=True)),
    _row(Fault.MOTION_SIGN_FLIP, "Roll and its rate, or the levels, are measured with the wrong "
         "sign, or are swapped.",
         "Check how motion sensor and level gauges are mounted and connected: roll is positive "
         "starboard down.",
         _found(_STOP, "the water against roll and pressure", Finding.WATER_SIGN)),
    _row(Fault.FOREIGN_SENDER, "A message comes faster than its cycle: two nodes send it, or its "
         "counter skips.",
         "Find the second sender of the identifier (candump) and stop it.",
         _found(_STOP, "frames heard and lost by the counter over 1.25 a cycle, eight too many",
             Finding.SECOND_SENDER),
         Condition(_STOP, "the address of another node was claimed under another name in the last "
             "10 s", lambda seen, _: seen.measured.claimed_twice)),
    _row(Fault.UNKNOWN_IDENTIFIERS, "Frames that are not in the catalogue take up the CAN bus.",
         "Find the node that sends them (candump) and stop it.",
         _found(_STOP, "over 10% of the bus in use by identifiers that are not in the catalogue",
             Finding.FLOOD)),
    _row(Fault.MOTION_SILENT, "No usable measurement comes from the motion sensor.",
         "Check the sensor's supply and bus connection, and what it sends: its "
         "quality, and values that jump, which are discarded.",
         Condition(_RAMP, "last good sample older than {motion_age_ms:g} ms, that of a second "
             "sensor than is allowed of it",
             lambda seen, _: seen.motion.age_ms > seen.motion_limit_ms,
             zero_within_ms=200, awaited=3),  # 250 after the sample, of which 40 ms are allowed
         Condition(_WARN, "one of two motion sensors: last good sample older than "
             "{motion_spare_age_ms:g} ms",
             lambda seen, _: seen.spare_age_ms > seen.spare_limit_ms)),
    _row(Fault.SENSORS_DISAGREE, "The two motion sensors disagree.",
         "Compare both with the horizon and a plumb line; mend or replace the one that is wrong.",
         _found(_RAMP, "roll apart by half a degree for 0.3 s, or their rates by as much at 2 w0",
             Finding.SENSORS_DISAGREE)),
    _row(Fault.TANK_SILENT, "No usable measurement comes from the tank's level gauges.",
         "Check the gauges' supply and bus connection, and the quality that they send.",
         Condition(_HALVE, "last good sample older than {tank_degraded_age_ms:g} ms",
             lambda seen, limits: seen.measured.tank_age_ms > limits.tank_degraded_age_ms,
             awaited=4),
         Condition(_RAMP, "last good sample older than {tank_age_ms:g} ms",
             lambda seen, limits: seen.measured.tank_age_ms > limits.tank_age_ms)),
    _row(Fault.PUMP_SENSOR_SILENT, "No usable measurement comes from the pump's pressure sensor.",
         "Check the sensor's supply and bus connection, and the quality that it sends.",
         Condition(_HALVE, "last good sample older than {pump_degraded_age_ms:g} ms",
             lambda seen, limits: seen.measured.pump_age_ms > limits.pump_degraded_age_ms),
         Condition(_RAMP, "last good sample older than {pump_age_ms:g} ms",
             lambda seen, limits: seen.measured.pump_age_ms > limits.pump_age_ms, awaited=5)),
    _row(Fault.PROTECTION, "Messages of a sensor, drive, valve or panel keep arriving damaged or "
         "out of order, or a panel has not the ship's key.",
         "Look for a second sender of their identifiers, a node that protects them wrongly, and "
         "disturbance on the cable; give the panel the key of the ship's file.",
         Condition(_RAMP, f"leaky bucket of rejected frames at {BUCKET_LIMIT}",
             lambda seen, _: not (seen.motion.valid and seen.measured.protection_valid)),
         _found(_RAMP, "three frames a second with a wrong CRC or data ID", Finding.DAMAGED),
         _found(_WARN, "a panel's third wrong proof of its key in succession",
             Finding.WRONG_PROOF)),
    _row(Fault.STUCK_SIGNAL, "The roll or the level stands still although the water is pushed.",
         "Check the motion sensor, the level gauges and whatever passes their messages on; at the "
         "quay whether the ship is aground or held.",
         _found(_RAMP, "roll still while the water moves, or level still while it is pushed",
             Finding.ROLL_STUCK | Finding.LEVEL_STUCK),
         _found(_RAMP, "heel removal: the heel answers two pumpings in a row by less than a "
             "third", Finding.HEEL_UNANSWERED)),
    _row(Fault.DRIFT, "Roll and integrated roll rate do not agree.",
         "Check the motion sensor: sign of each, a signal that stands still, alignment, bias of "
         "the gyroscope, filter of the roll.",
         _found(_HALVE, "roll off the integrated rate by six times its noise", Finding.DRIFT),
         _found(_RAMP, "the same for 30 s, or four times as far", Finding.DRIFT_LASTS)),
    _row(Fault.VOLUME, "The port and starboard levels do not add up to the water in the tank.",
         "Check the level gauges, then the tank for a leak or a wrong filling.",
         _found(_HALVE, "mean of both levels off zero by 1.5% of the still-water height",
             Finding.VOLUME),
         _found(_RAMP, "the same for 30 s, or three times as far", Finding.VOLUME_LASTS)),
    _row(Fault.SPIKES, "Samples of motion sensor or level gauges had to be discarded again and "
         "again.",
         "Check the sensors' cables and supply.",
         _found(_RAMP, "five spikes (the count falls by one each second)", Finding.SPIKES)),
    _row(Fault.NOISE, "The motion sensor or a level gauge is noisier than its figures.",
         "Check the sensor's fastening, cable and supply, and the section `sensors` of the "
         "configuration.",
         _found(_WARN, "five times the noise of the section `sensors`, 3.75 times in the sum of "
             "the levels, over 0.7 s", Finding.NOISE)),
    _row(Fault.SIGNAL_DELAYED, "The water moves before the measured roll does: the motion sensor "
         "is late.",
         "Check the motion sensor's filter and whatever passes its messages on.",
         _found(_RAMP, "roll late by a thirtieth of the roll period", Finding.MOTION_LATE)),
    _row(Fault.DRIVE_NOT_FOLLOWING, "The pump's pressure does not follow the command, or the pump "
         "presses though it is off.",
         "If the pump presses though it is off, cut its power (hard-wired stop, main switch). "
         "Check the pump for blockage, the drive for limits and local operation, and the pressure "
         "sensor.",
         _found(_STOP, "15% of the pressure limit off for 500 ms; drive off: and 2 kPa per m of "
             "level", Finding.DRIVE_LOST, ends_passive=True),
         _found(_RAMP, "the same for 300 ms", Finding.DRIVE_LAGS)),
    _row(Fault.SATURATION, "The pump has been held at its limit on one side, or the tank takes no "
         "more heel away.",
         "Correct a steady heel by ballast; lower the law's gains if the sea asks for more than "
         "the pump has.",
         _found(_WARN, "command at its limit to one side, or drive at one of its own, for 10 s",
             Finding.SATURATED),
         _found(_WARN, "heel removal: the level is at its limit, and a heel over start_rad is left",
             Finding.TANK_USED_UP)),
    _row(Fault.ROLL_AMPLIFIED, "The ship rolls more than it would with the pump at rest.",
         "Retune the law, or use one for this load and sea.",
         _found(_RAMP, "roll over 1.25 times the passive twin's for a quarter of a roll period "
             "and over 1.1 times in 36 roll periods, or over 1.6 times; with a valve a tenth "
             "more; and over 0.5 degrees RMS", Finding.ROLL_AMPLIFIED)),
    _row(Fault.HEEL_LIMIT, "The ship rolls or heels beyond the limit for active control.",
         "Wait until the roll is small; correct the heel by ballast; check the motion sensor.",
         Condition(_RAMP, "roll over {roll_limit_rad:g} rad, or its mean over a minute over "
             "{heel_limit_rad:g} rad", lambda seen, limits: not (
             abs(seen.motion.roll_rad) <= limits.roll_limit_rad
             and abs(seen.heel_rad) <= limits.heel_limit_rad)),  # so that NaN is beyond, too
         # a ship that rolls through upright is upright twice in a period
         _found(_RAMP, "heel removal: the root mean square of the roll is over its most_roll_rad, "
             "as it is at sea", Finding.NOT_IN_HARBOUR),
         Condition(_WARN, "stimulation: its own limit of roll or level was passed; it gives no "
             "pressure until it is armed again", lambda seen, _: seen.own.law_passed_limit),
         Condition(_REFUSE, f"roll over {{roll_limit_rad:g}} rad within the last {ROLL_CALM_S} s",
             lambda seen, _: seen.rolled_over_ms < 1e3 * ROLL_CALM_S)),
    _row(Fault.STABILITY_LOW, "The ship's metacentric height may be below the limit of its "
         "stability booklet, or no estimates of it come any more: the panel shows no GM then.",
         "Compare with the loading computer; take on ballast or remove weight from above. Without "
         "estimates (the log has the reason) start the controller again when that can be done.",
         Condition(_WARN, "interval of the estimated GM, two standard deviations, reaches below "
             "the vessel's least_gm_m, or no estimate for three intervals",
             lambda seen, _: seen.own.gm_low),
         _found(_RAMP, "heel removal: the heel answers two pumpings in a row by more than twice "
             "what is due", Finding.HEEL_OVERDONE)),
    _row(Fault.DRIVE_WARNING, "The pump drive warns: it may soon trip or not hold the pressure.",
         "Read what the drive warns of. Temperature: cooling, load. Voltage: supply. "
         "Command: bus, its cable and load. Sensor: the drive's pressure feedback.",
         Condition(_WARN, "a warning bit in the last DRIVE_STATUS_2",
             lambda seen, _: seen.measured.drive_warns)),
    _row(Fault.DEVICE_ERROR, "A CANopen device reports an error of its own (EMCY).",
         "Look the code up in the device's manual and remove the cause. It is over when the "
         "device says so (code 0000h) or starts anew.",
         Condition(_WARN, "an emergency message of a CANopen drive, sensor or valve, not over yet",
             lambda seen, _: seen.measured.device_error)),
    _row(Fault.FORECAST_IGNORED, "The forecast of the waves is not used: it is late, missing, of "
         "other versions, or the ship moves otherwise. The law goes on without it.",
         "Check the preview station: supply, bus, the quality and heartbeat that it sends, and "
         "sign, scale and time of its forecast against the roll.",
         Condition(_WARN, "newest good WAVE_FORECAST older than {forecast_age_ms:g} ms",
             lambda seen, limits: seen.measured.forecast_age_ms > limits.forecast_age_ms),
         Condition(_WARN, "the law finds that the ship's motion contradicts it",
             lambda seen, _: seen.own.doubts_forecast)),
    _row(Fault.BUS_DEGRADED, "Frames are lost on the CAN bus, a node sends too seldom, or a "
         "measurement has gaps.",
         "Check the cable, its plugs and termination, gateways between the nodes, the load, and "
         "the nodes' cycle times.",
         _found(_WARN, "over 0.1% of a message's frames missing by its counter, or in bursts of a "
             "message of 25 ms or less, five too many; or under 0.75 a cycle for 2 s",
             Finding.FRAMES_LOST),
         _found(_HALVE, "gaps of motion, levels or pressure, or a level over 0.9 of the tank, have "
             "kept the tank's equation from judging for a roll period", Finding.UNWATCHED),
         _found(_RAMP, "the same for three roll periods", Finding.UNWATCHED_LONG)),
    _row(Fault.OVERRUN, "The controller's loop ran too late.",
         "Stop other work on the computer and give the controller real-time scheduling.",
         Condition(_STOP, "a tick {long_overrun_ms:g} ms late or more",
             # counted in whole ticks: what is 50 here was up to 60
             lambda seen, limits: seen.tick_late_ms >= limits.long_overrun_ms),
         Condition(_RAMP, "{overruns_in_ten} of the last ten ticks late; one that comes after the "
             "time of the next counts for that, too", lambda seen, limits: (
             limits.overruns_in_ten is not None
             and seen.overruns_in_ten >= limits.overruns_in_ten)),
         Condition(_WARN, "one of them", lambda seen, _: seen.overruns_in_ten > 0)),
    _row(Fault.NOT_COMMISSIONED, "No commissioning was passed with this configuration: signs and "
         "scales are not known.",
         "Run utank-hil commission with this controller's file at the quay.",
         Condition(_REFUSE, "no record of a passed commissioning with this vessel and these "
             "sensors", lambda seen, _: not seen.own.commissioned)),
    _row(Fault.OPERATOR_SILENT, "The operator's panel is not heard.",
         "Check that the panel runs and is connected to the bus.",
         Condition(_REFUSE, "order or heartbeat silent for over {panel_age_to_arm_ms:g} ms",
             lambda seen, limits: seen.measured.panel_age_ms > limits.panel_age_to_arm_ms),
         Condition(_RAMP, "order or heartbeat silent for over {panel_age_armed_ms:g} ms",
             lambda seen, limits: seen.measured.panel_age_ms > limits.panel_age_armed_ms)),
)  # fmt: skip


def fault_words(fault: Fault) -> tuple[str, str]:
    """Return what happened and what to do, for people; empty for a code without a row."""
    return next(((row.happened, row.remedy) for row in FAULTS if row.code == fault), ("", ""))


def fault_text(fault: Fault) -> str:
    """Return the fault's name and, for people, what happened and what to do."""
    happened, remedy = fault_words(fault)
    return f"{fault.name}: {happened} {remedy}" if happened else fault.name
