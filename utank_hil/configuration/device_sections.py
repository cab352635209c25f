"""Parts of a ship's section ``devices``: messages, signals, validity, protection, drive."""

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from utank_hil.base.parameters import Finite, Problem, Range
from utank_hil.base.tick import TICK_S
from utank_hil.canbus.frame import LONGEST_ID, LONGEST_STANDARD_ID
from utank_hil.canbus.profiles.drive_plan import COMMAND_MS, MODES, DrivePlan, Place
from utank_hil.canbus.profiles.field import Field as BusField
from utank_hil.configuration.device_files import NATIVE, drive_with_eds, place_of
from utank_hil.configuration.files import Section
from utank_hil.control.pressure_loop import LoopMargins, loop_margins
from utank_hil.dynamics.pump import Pump


def _whole(value: Any) -> Any:
    if isinstance(value, bool):
        said = str(value).lower()
        raise ValueError(f"is {said}, as YAML reads on, yes, off and no: quote a name")
    if isinstance(value, str):
        try:
            return int(value, 0)
        except ValueError:
            raise ValueError(f"must be a whole number such as 18 or 0x12, got {value!r}") from None
    return value


_WHOLE: Final = BeforeValidator(_whole)
Whole = Annotated[int, Range(least=-(1 << 63), most=(1 << 64) - 1), _WHOLE]
Name64 = Annotated[int, Range(least=0, most=(1 << 64) - 1), _WHOLE]
Id29 = Annotated[int, Range(least=0, most=LONGEST_ID), _WHOLE]
EmergencyCode = Annotated[int, Range(least=1, most=0xFFFF), _WHOLE]
Id11 = Annotated[int, Range(least=0, most=LONGEST_STANDARD_ID), _WHOLE]
Pgn = Annotated[int, Range(least=0, most=0x3FFFF), _WHOLE]
SourceAddress = Annotated[int, Range(least=0, most=0xFD), _WHOLE]
NodeNumber = Annotated[int, Range(least=1, most=127), _WHOLE]
Cycle = Annotated[float, Range(above=0, most=10_000)]

_DEGREE: Final = math.pi / 180
UNITS: Final[dict[str, tuple[str, float]]] = {
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", _DEGREE), "°": ("rad", _DEGREE),
    "rad/s": ("rad_s", 1.0), "rad.s-1": ("rad_s", 1.0), "mrad/s": ("rad_s", 1e-3),
    "deg/s": ("rad_s", _DEGREE), "°/s": ("rad_s", _DEGREE),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3),
    "Pa": ("pa", 1.0), "kPa": ("pa", 1e3), "mbar": ("pa", 1e2), "bar": ("pa", 1e5),
    "m3/s": ("m3_s", 1.0), "l/s": ("m3_s", 1e-3), "m3/h": ("m3_s", 1 / 3600), "%": ("", 1e-2),
}  # fmt: skip
"""Units that makers write: end of the name of what is measured, and factor."""


class _Part(Section):
    model_config = ConfigDict(populate_by_name=True)


class FieldSection(_Part):
    """Layout of a signal as in a DBC."""

    start: Annotated[int, Range(least=0, most=63), _WHOLE]
    """First bit: the least of a signal with the least byte first, else the most."""
    bits: Annotated[int, Range(least=1, most=64), _WHOLE]  #: Number of bits.
    big_endian: bool = False  #: Most byte first.
    signed: bool = False  #: Two's complement.
    real: bool = False  #: IEEE 754.
    scale: Finite = 1.0  #: Physical value of one count.
    offset: Finite = 0.0  #: Physical value of no counts.
    unit: str = ""  #: Unit of the physical value.
    object: str = ""  #: CANopen object that is mapped there, as 7130h:1.
    least_raw: Whole | None = None  #: Least count that is a value.
    most_raw: Whole | None = None  #: Counts outside of these two are not available, or an error.

    def within(self, other: "FieldSection") -> bool:
        """Whether its bits are among another's."""
        end, last = self.start + self.bits, other.start + other.bits
        return self is other or (other.start <= self.start and end <= last and self.bits < 8)

    def field(self, length: int) -> BusField:
        """The signal in a frame of so many bytes."""
        return BusField(length=length, **self.model_dump(exclude={"unit", "object"}))


class CanopenSection(Section):
    """What is asked of a CANopen node before it counts."""

    node: NodeNumber | None = None  #: CANopen node.
    identity: Annotated[tuple[Whole | None, ...], Field(max_length=4)] = ()
    """Vendor, product, revision and serial number in 1018h; null for any. With `eds: FILE` those of
    the file, unless given."""
    require: Annotated[dict[str, Whole | None], Field(default_factory=dict)]
    """Objects, as "0x605A" or "0x1400:5", that are written and must read back so; null where the
    device lacks one. A drive's are 6007h: 3, 605Ah: 2, 605Eh: 2 and these."""

    def require_problems(self) -> Iterator[Problem]:
        """What is no object."""
        for written in self.require:
            try:
                place_of(written)
            except ValueError:
                yield "require", f"{written!r} is no object: write 0x605A, or 0x1400:5"

    def required(self) -> tuple[tuple[Place, int], ...]:
        """Objects and what they must be."""
        return tuple(
            (place_of(key), value) for key, value in self.require.items() if value is not None
        )


class MessageSection(_Part):
    """Layout and identifier of a message: by `id`, by `pgn` and source, or by `cob` and node."""

    id: Id29 | None = None  #: Identifier.
    format: Literal["11bit", "29bit", "sentence"] = "11bit"
    """Length of the identifier; on a line, the sentence that it stands for."""
    pgn: Pgn | None = None  #: Group by SAE J1939-21; any priority is accepted.
    cob: Id11 | None = None  #: Identifier to which the node's number is added.
    bytes: Annotated[int, Range(least=1, most=8), _WHOLE] = 8
    """Length; a frame of another one is refused."""
    cycle_ms: Cycle | None = None  #: Of a message that has another cycle than the device's.
    pdo: Annotated[int, Range(least=1, most=512), _WHOLE] | None = None
    """Number of the sent PDO (TPDO) that it is: by it the device is configured and read back."""
    pdo_type: Literal[254, 255] = 255  #: Its type of transmission, by event timer.
    only: "ConditionSection | None" = None
    """Of an identifier with several contents: which of them, by a signal of this message."""
    signals: Annotated[dict[str, FieldSection], Field(default_factory=dict)]
    """Layouts of its signals."""


class ScaledSection(_Part):
    """How a value follows from a signal, or the other way round."""

    sign: Literal[1, -1] = 1  #: -1 turns the value round.
    scale: Annotated[float, Range(least=-1e9, most=1e9)] | None = None
    """In place of the factor of its unit."""
    offset: Annotated[float, Range(least=-1e9, most=1e9)] = 0.0
    """In the unit of the value, before the sign is applied."""


class SignalSection(ScaledSection):
    """What one measured value is made of."""

    from_: Annotated[str, Field(alias="from")] = ""  #: Signal, as MESSAGE.SIGNAL.
    source: Literal["measured", "derived"] = "measured"
    """Measured, or derived as the slope of the roll."""
    least: Finite = -1e300  #: Least physical value, in the maker's unit, that is one.
    most: Finite = 1e300
    """Range in the maker's unit, outside of which there is no value, as a broken 4-20 mA wire."""


class CommandSection(ScaledSection):
    """Where a command goes: the signal's value is that of the command, as of `SignalSection`."""

    to: str  #: Signal, as MESSAGE.SIGNAL; all commands of a device are in one message.


class ConditionSection(_Part):
    """What a status must say for the values to be valid."""

    from_: Annotated[str, Field(alias="from")]  #: Status word, as MESSAGE.SIGNAL.
    mask: Whole = (1 << 64) - 1  #: Bits that count.
    in_: Annotated[tuple[Whole, ...], Field(alias="in", min_length=1)]
    """Values of these bits that are allowed."""


class StampSection(_Part):
    """The device's own time in a message."""

    from_: Annotated[str, Field(alias="from")]  #: Signal, as MESSAGE.SIGNAL.
    us: Annotated[float, Range(above=0, most=1e6)]  #: Microseconds of one count.


class CrcSection(_Part):
    """A checksum of eight bits over all other bytes of a message."""

    message: str  #: Message that carries it.
    byte: Annotated[int, Range(least=0, most=7), _WHOLE]  #: Its place in the frame.
    polynomial: Annotated[int, Range(least=0, most=255), _WHOLE] = 0x1D
    """Polynomial without its highest bit."""
    start: Annotated[int, Range(least=0, most=255), _WHOLE] = 0xFF
    """Value that the register begins with."""
    final: Annotated[int, Range(least=0, most=255), _WHOLE] = 0xFF
    """Value that is applied to the result by exclusive or."""


class AuthenticationSection(_Part):
    """How a panel shows that it has a key, before it may arm."""

    challenge: str  #: Message of 8 bytes that the controller sends each second.
    proof: str
    """Message of 8 bytes that the panel sends after an order with `arm`: the first 8 of the
    AES-CMAC of challenge and order's frame."""
    key: str
    """File of the AES-128 key in 32 hexadecimal digits, readable by its owner only; a path begins
    with `./`. It is read where the controller starts, and is no part of the ship's version."""


class ProtectionSection(_Part):
    """What tells frames that are wrong, old or not the device's."""

    counters: tuple[str, ...] = ()  #: Signals that count the frames of their message.
    counts: Literal["message", "identifier"] = "message"
    """Of an identifier with several contents: whether a counter counts the frames of one of them,
    or all of the identifier."""
    crcs: tuple[CrcSection, ...] = ()  #: Checksums.
    stamps: tuple[StampSection, ...] = ()  #: The device's own times.
    unchanged_ms: Cycle | None = None  #: Content that has been the same for longer is not used.
    n2k_name: Name64 | None = None
    """NAME that the device claims its source address with, SAE J1939-81."""


def unit_of(value: str) -> str:
    """The unit at the end of a value's name, as in `UNITS`; empty for a switch."""
    for unit in ("rad_s", "m3_s", "rad", "pa", "m"):
        if value.endswith(f"_{unit}"):
            return unit
    return ""


LEAST_PHASE_DEG: Final = 45.0
LEAST_GAIN: Final = 2.0
"""Least margins of the pressure loop: the pump's map may be off by a factor of two."""
REQUIRE: Final = {"0x6007": 3, "0x605A": 2, "0x605E": 2}
"""Quick stop where the controller's heartbeat ends or the node is stopped; it brakes on its ramp,
then the drive switches off; so it does at a fault. CiA 402-2; 35 EDS of seven makers."""


def _required(given: dict[str, Any]) -> dict[str, Any]:
    """`REQUIRE` and what a file gives, whose objects may be written in another way."""
    named = set()
    for written in given:
        with suppress(ValueError):  # no object: refused elsewhere
            named.add(place_of(str(written)))
    return {key: value for key, value in REQUIRE.items() if place_of(key) not in named} | given


_TORQUES: Final = (100, 3000)
"""Counts of the target torque at the pump's greatest pressure: ten times the torque that is needed,
in steps of 1 %, to a drive that gives three times its rated one for a while."""
_SPEEDS: Final = (1000, 2**31)


class DriveSection(CanopenSection):
    """Drive of the pump."""

    profile: Literal["native", "cia402"] = NATIVE
    """`cia402`, or `native` for the drive of this project's own catalogue."""
    bus: str = ""  #: Interface that it is on; empty for the controller's own.
    controller_node: NodeNumber = 127  #: CANopen node that the controller's heartbeat is from.
    mode: Literal["torque", "cyclic_torque", "velocity", "cyclic_velocity"] | None = None
    """Mode of operation, in 6060h 4, 10, 3, 9."""
    pressure_pa_per_unit: Annotated[float, Range(least=-1e9, most=1e9)] | None = None
    """Measured: pressure, in still water, of one count of the target torque 6071h."""
    speed_rad_s_per_unit: Annotated[float, Range(least=-1e6, most=1e6)] | None = None
    """Speed of the pump's rotor of one count of 60FFh and 606Ch."""
    delay_ms: Annotated[float, Range(least=20, most=500)] = 50.0
    """From a change of the pressure to the torque that answers it, as the loop is designed for."""
    heartbeat_ms: Annotated[int, Range(least=20, most=100)] = 50
    """Time without the controller's heartbeat after which the drive stops; and its own cycle."""
    echo: Literal["command", "demand"] = "command"
    """What the drive sends back: control word and target, or its demand (6074h, 606Bh)."""
    synchronous: bool = True  #: The drive sends at SYNC, else by its event timer.
    stop_within_ms: Annotated[float, Range(least=20, most=500)] = 150.0
    """From a stop to a fifth of the pressure, and from a stop or the controller's last frame to a
    tenth of the speed: measured by `commission` and `conform`, and refused beyond. Of a native
    drive, too."""

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        content = {"profile": "cia402", **content} if "eds" in content else content
        if content.get("profile", NATIVE) == NATIVE:
            return content
        given = content.get("require", {})
        content = content | {"require": _required(given) if isinstance(given, dict) else given}
        return drive_with_eds(content) if "eds" in content else content

    @property
    def native(self) -> bool:
        """Whether it is the drive of this project's own catalogue."""
        return self.profile == NATIVE

    def problems(self) -> Iterator[Problem]:
        """What is wrong or missing."""
        if self.native:
            if self.bus:
                yield "bus", "is for a drive with a profile: the native one is on the own bus"
            return
        needed = ["node", "mode", "speed_rad_s_per_unit"]
        torque = self.mode is not None and MODES[self.mode].torque
        for name in [*needed, "pressure_pa_per_unit"][: 4 if torque else 3]:
            if not getattr(self, name):
                yield name, "is required but missing, or zero"
        if self.node == self.controller_node:
            yield "controller_node", "is the drive's own node: choose another"
        yield from self.require_problems()

    def pump_problems(self, pump: Pump | None) -> Iterator[Problem]:
        """What does not fit to the pump."""
        if self.native:
            return
        if pump is None:
            yield "devices.pump", "is a drive, but the ship has no pump: add it, or leave this out"
        elif not MODES[self.mode or ""].torque and pump.lag_s * pump.speed_bandwidth_rad_s <= 1:
            own_s = 1 / pump.speed_bandwidth_rad_s
            yield "pump.lag_s", f"must exceed the lag of the drive's speed loop, {own_s:.3g} s"

    def unusual(self, pump: Pump) -> Iterator[Problem]:
        """What suits no drive of this pump, by its counts at the greatest pressure and speed."""
        for name, of, most, (least_counts, most_counts), words in (
            ("pressure_pa_per_unit", self.pressure_pa_per_unit, pump.max_pressure_pa, _TORQUES,
             "6071h counts thousandths of the rated torque (6076h): measure it once more"),
            ("speed_rad_s_per_unit", self.speed_rad_s_per_unit, pump.max_speed_rad_s, _SPEEDS,
             "few for 606Ch. If its unit (60A9h) and the gear are right, all is well"),
        ):  # fmt: skip
            if of and not least_counts <= most / abs(of) <= most_counts:
                at_most = f"{most:.4g} are {most / abs(of):.3g} counts"
                yield f"devices.pump.{name}", f"is {of:.4g}, so the pump's {at_most}: {words}"

    def margins(self, sensor_late_s: float) -> LoopMargins:
        """Margins of the pressure loop with a pressure that is late by cycle and latency."""
        late_s = sensor_late_s + TICK_S + COMMAND_MS * 1e-3
        return loop_margins(self.delay_ms * 1e-3, late_s)

    def plan(self, bus: int, pump: Pump) -> DrivePlan:
        """The drive as the controller commands and hears it, on the interface of this number."""
        assert self.node is not None
        assert self.mode is not None
        assert self.speed_rad_s_per_unit is not None
        mode = MODES[self.mode]
        per_si = 1 / self.speed_rad_s_per_unit
        if mode.torque:  # T = p A dP, see `utank_hil.dynamics.pump`
            assert self.pressure_pa_per_unit is not None
            per_si = 1 / (self.pressure_pa_per_unit * pump.pitch_m * pump.duct_area_m2)
        return DrivePlan(
            bus,
            self.node,
            self.controller_node,
            mode,
            per_si,
            self.speed_rad_s_per_unit,
            self.delay_ms * 1e-3,
            self.heartbeat_ms,
            self.identity,
            self.required(),
            self.echo == "command",
            self.synchronous,
            self.stop_within_ms,
        )


NATIVE_DRIVE: Final = DriveSection.model_validate({})
