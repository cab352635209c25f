"""Parameters of the guard, from a controller's configuration, in the numbers of the frames."""

import math
from dataclasses import dataclass
from typing import Any, Final

from utank_hil import canbus
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus.profiles.guarded import (
    LEVEL_M,
    PRESSURE_PA,
    RATE_RAD_S,
    ROLL_RAD,
    GuardPart,
    Stream,
    guard_parts,
    unchanged_ticks,
)
from utank_hil.configuration import ControllerConfig
from utank_hil.safety.monitors.thresholds import thresholds_of

TICK_MS: Final = TICK_NS / 1e6
MOST_RATE: Final = 32000
MOST_STEP: Final = 65535  #: Greater than any step of 16 bits.
LEVEL_SHARE: Final = 0.97
"""Of the level at which a reservoir is full or empty; the shipped switches close at 0.943."""
STREAMS: Final[tuple[tuple[type[tuple[Any, ...]], canbus.Address], ...]] = (
    (canbus.PumpCommand, canbus.Address.CONTROLLER),
    (canbus.DriveStatus1, canbus.Address.DRIVE),
    (canbus.SensorMotion, canbus.Address.SENSORS),
    (canbus.SensorMotion, canbus.Address.SENSORS_2),
    (canbus.SensorTank, canbus.Address.SENSORS),
    (canbus.SensorPump, canbus.Address.SENSORS),
    (canbus.OperatorCommand, canbus.Address.OPERATOR),
    (canbus.OperatorCommand, canbus.Address.OPERATOR_2),
    (canbus.HardwiredInputs, canbus.Address.HARDWIRED),
)  #: Native messages by `Stream`.
NOBODY: Final = 0xFFFFFFFF
"""Identifier of a native message where a device of another maker is in its place."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message that the guard hears."""

    can_id: int
    patience: int  #: Greatest age under pressure in ticks; 0: its silence is not judged.
    unchanged: int  #: Ticks after which values that stand are none; 0: they may.
    data_ids: bytes


@dataclass(frozen=True, slots=True)
class GuardParameters:
    """The table `struct guard_parameters` of guard.h."""

    messages: tuple[Message, ...]
    pressure: int
    step: int
    error: int
    free_rotor: int
    level: int
    roll: int
    roll_rate: int
    heel: int
    second_station: int
    torque_drive: int  #: Whether the drive is told torque or speed, and no pressure.
    parts: tuple[GuardPart, ...]

    @property
    def header(self) -> str:
        """The table as a C header."""
        rows = "".join(
            f"    {{0x{each.can_id:08X}U, {each.patience}U, {each.unchanged}U, "
            f"{{{', '.join(f'{number}U' for number in each.data_ids)}}}}},\n"
            for each in self.messages
        )
        numbers = ", ".join(str(getattr(self, name)) for name in self.__slots__[1:-1])
        parts = "".join(f"    {{{_row(each)}}},\n" for each in self.parts) or "    {0}\n"
        return (
            "/* Written by python -m firmware_sim.guard; do not edit. */\n"
            '#include "guard.h"\n\n'
            "static const struct guard_parameters GUARD_PARAMETERS = {\n"
            f"    {{\n{rows}    }},\n    {numbers},\n"
            f"    {len(self.parts)}U,\n    {{\n{parts}    }}\n}};\n"
        )


def _row(part: GuardPart) -> str:
    crc = part.crc
    values = {name: f"{int(getattr(part, name))}" for name in GuardPart.__slots__ if name != "crc"}
    for name in ("can_id", "id_bits", "mask", "sign_bit"):
        values[name] = f"0x{getattr(part, name):X}U"
    words = list(values.values())
    words.insert(3, f"{{{crc.byte}U, {crc.polynomial}U, {crc.start}U, {crc.final}U}}")
    return ", ".join(words)


def guard_parameters(config: ControllerConfig) -> GuardParameters:
    """Return the parameters for a ship and the limits of its controller.

    The guard is more patient than the controller: its ages end after the controller's ramps.
    ValueError is raised if the ship has no pump, or devices of other makers that the guard can't
    judge.
    """
    vessel, safety, limits = config.vessel, config.safety, config.limits
    if vessel.pump is None:
        raise ValueError("the ship has no pump: there is nothing to guard")
    parts = guard_parts(vessel.foreign)
    unchanged = unchanged_ticks(vessel.foreign)
    first_ms, second_ms = safety.motion_ages_ms
    second_station = vessel.redundancy.second_station
    patience_ms = (
        150.0,
        safety.drive_age_ms + 140,
        first_ms + 300,
        second_ms + 300 if vessel.redundancy.second_motion_sensor else 0.0,
        safety.tank_age_ms + 1200,
        safety.pump_age_ms + 1200,
        safety.panel_age_armed_ms + 1200,
        safety.panel_age_armed_ms + 1200 if second_station else 0.0,
        safety.hardwired_age_ms + 150 if vessel.redundancy.hardwired_inputs else 0.0,
    )
    thresholds = thresholds_of(config.plant, safety.roll_limit_rad, config.sensors)
    catalogue, messages = canbus.load_catalogue(), []
    others = {part.stream for part in parts}
    for stream, (kind, source) in zip(Stream, STREAMS, strict=True):
        codec = catalogue.codec(kind, source)
        assert codec.data_ids is not None  # the catalogue has checked it
        can_id = NOBODY if stream in others else codec.can_id
        patience, still = math.ceil(patience_ms[stream] / TICK_MS), unchanged.get(stream, 0)
        messages.append(Message(can_id, patience, still, codec.data_ids))
    return GuardParameters(
        tuple(messages),
        pressure=math.ceil(limits.pressure_pa / PRESSURE_PA) + 1,
        # a cycle, rounded twice; 16 of it fit 32 bits
        step=min(math.ceil(limits.rate_pa_s * 0.02 / PRESSURE_PA) + 2, MOST_STEP),
        error=round(thresholds.pressure_error_pa / PRESSURE_PA),
        free_rotor=round(thresholds.free_rotor_pa_m / PRESSURE_PA),
        level=round(2 * LEVEL_SHARE * vessel.tank.level_limit_m / LEVEL_M),
        roll=round(safety.roll_limit_rad / ROLL_RAD),
        roll_rate=min(round(thresholds.roll_most_rad_s / RATE_RAD_S), MOST_RATE),
        heel=round(safety.heel_limit_rad / ROLL_RAD),
        second_station=int(second_station),
        torque_drive=int(vessel.foreign.pump is not None),
        parts=parts,
    )
