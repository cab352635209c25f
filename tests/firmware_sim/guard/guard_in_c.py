"""The guard in C, compiled on this machine and driven through ctypes."""

import ctypes
import subprocess
from functools import cache
from pathlib import Path

from firmware_sim.guard import parameters as module
from firmware_sim.guard.parameters import GuardParameters
from firmware_sim.guard.reference import Guard
from utank_hil.canbus.profiles.guarded import MOST_PARTS, PLACES, GuardPart, Stream

SOURCE = Path(module.__file__).parent
SOURCES = sorted(SOURCE.glob("*.c"))
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffreestanding")


TRAPS = ("-fsanitize=undefined", "-fsanitize-undefined-trap-on-error")
"""An index beyond its array, or a sum beyond its type, ends the process."""


class _Message(ctypes.Structure):
    _fields_ = [
        ("can_id", ctypes.c_uint32),
        ("patience", ctypes.c_uint16),
        ("unchanged", ctypes.c_uint16),
        ("data_ids", ctypes.c_uint8 * 16),
    ]


class _Crc(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint8) for name in ("at", "polynomial", "start", "final")]


class _Part(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_uint32) for name in ("can_id", "id_bits")),
        ("length", ctypes.c_uint8),
        ("crc", _Crc),
        *((name, ctypes.c_uint8) for name in ("stream", "place")),
        ("old", ctypes.c_uint16),
        *((name, ctypes.c_uint8) for name in ("most_first", "shift")),
        *((name, ctypes.c_uint32) for name in ("mask", "sign_bit")),
        *((name, ctypes.c_int64) for name in ("least", "most", "times", "plus", "by")),
        ("otherwise", ctypes.c_int32),
    ]


class _Parameters(ctypes.Structure):
    _fields_ = [
        ("messages", _Message * len(Stream)),
        *((name, ctypes.c_int32) for name in GuardParameters.__slots__[1:-3]),
        *((name, ctypes.c_uint8) for name in ("second_station", "torque_drive", "part_count")),
        ("parts", _Part * MOST_PARTS),
    ]


@cache
def library(folder: Path) -> ctypes.CDLL:
    out = folder / "guard.so"
    words = ["cc", *FLAGS, *TRAPS, "-O2", "-shared", "-fPIC", *SOURCES, "-o", out]
    subprocess.run([str(word) for word in words], check=True)
    found = ctypes.CDLL(str(out))
    found.guard_tick.restype = ctypes.c_uint8
    found.guard_receive.argtypes = [
        ctypes.c_void_p, ctypes.c_uint32, ctypes.c_char_p, ctypes.c_uint8,
    ]  # fmt: skip
    return found


class _Stream(ctypes.Structure):
    _fields_ = [
        ("age", ctypes.c_uint16),
        *((name, ctypes.c_uint8) for name in ("expected", "candidate", "run")),
    ]


class _Guard(ctypes.Structure):
    """`struct guard`."""

    _fields_ = [
        ("parameters", ctypes.c_void_p),
        ("streams", _Stream * len(Stream)),
        ("values", (ctypes.c_int32 * PLACES) * len(Stream)),
        ("same", ctypes.c_uint16 * len(Stream)),
        ("part_age", ctypes.c_uint16 * MOST_PARTS),
        ("part_raw", ctypes.c_uint32 * MOST_PARTS),
        *(
            (name, ctypes.c_int32)
            for name in ("command", "drive", "pump", "roll", "rate", "heel", "level")
        ),
        *((name, ctypes.c_int32 * 2) for name in ("least", "most")),
        *((name, ctypes.c_uint16) for name in ("window", "unarmed", "off", "high", "rolled")),
        *((name, ctypes.c_uint8) for name in ("state", "tank_high", "hardwired_high", "open")),
        *((name, ctypes.c_uint8 * 2) for name in ("arm_bit", "reset_bit", "stop_bit")),
        *((name, ctypes.c_uint8) for name in ("armed", "reset", "stop_heard", "bad_command")),
    ]


def _part(part: GuardPart) -> _Part:
    crc = part.crc
    values = {name: int(getattr(part, name)) for name in GuardPart.__slots__ if name != "crc"}
    return _Part(crc=_Crc(crc.byte, crc.polynomial, crc.start, crc.final), **values)


def _table(parameters: GuardParameters) -> _Parameters:
    messages = [
        _Message(each.can_id, each.patience, each.unchanged, (ctypes.c_uint8 * 16)(*each.data_ids))
        for each in parameters.messages
    ]
    numbers = [getattr(parameters, name) for name in GuardParameters.__slots__[1:-1]]
    parts = [_part(each) for each in parameters.parts]
    return _Parameters(
        (_Message * len(Stream))(*messages), *numbers, len(parts), (_Part * MOST_PARTS)(*parts)
    )


class GuardInC:
    """As `Guard`."""

    def __init__(self, parameters: GuardParameters, folder: Path) -> None:
        self._library = library(folder)
        self._parameters = table = _table(parameters)
        for place in range(table.part_count, MOST_PARTS):  # rows that are none say otherwise
            table.parts[place] = table.parts[0]
            table.parts[place].times += 1
            table.parts[place].old = 0
        self._state = ctypes.create_string_buffer(b"\xa5" * 4096)
        self._library.guard_start(self._state, ctypes.byref(self._parameters))

    @staticmethod
    def table_of(parameters: GuardParameters) -> bytes:
        """The table's bytes, as a C compiler lays them out."""
        return bytes(_table(parameters))

    def receive(self, can_id: int, data: bytes) -> None:
        self._library.guard_receive(self._state, can_id, data, len(data))

    def tick(self) -> int:
        return int(self._library.guard_tick(self._state))

    def put(self, name: str, value: int) -> None:
        """Put a number there."""
        setattr(_Guard.from_buffer(self._state), name, value)

    def agrees(self, python: Guard) -> None:
        """Hold what it has read to what the guard in Python has."""
        head = _Guard.from_buffer(self._state)
        for name, value in {
            "command": python._command, "drive": python._drive_pa, "pump": python._pump_pa,
            "roll": python._roll, "rate": python._rate, "heel": python._heel,
            "level": python._level, "window": python._window, "unarmed": python._unarmed,
            "off": python._off, "high": python._high, "rolled": python._rolled,
            "state": python._state, "tank_high": python._switches[Stream.TANK],
            "hardwired_high": python._switches[Stream.HARDWIRED], "open": python._loop_open,
            "armed": python._armed, "reset": python._reset, "stop_heard": python._stop_heard,
            "bad_command": python._bad_command,
        }.items():  # fmt: skip
            assert getattr(head, name) == value, name
        assert [list(head.least), list(head.most)] == [python._least, python._most]
        bits = zip(head.arm_bit, head.stop_bit, head.reset_bit, strict=True)
        assert list(bits) == python._bits
        assert [each.age for each in head.streams] == python._age
        devices = python._devices
        count = len(devices._raw)
        assert list(head.part_raw)[:count] == devices._raw
        assert list(head.part_age)[:count] == devices._age
        assert list(head.same) == devices._same
        for stream in {part.stream for part in python.parameters.parts}:
            assert list(head.values[stream]) == devices.values[stream]
