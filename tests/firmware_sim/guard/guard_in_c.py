"""The guard in C, compiled on this machine and driven through ctypes."""

import ctypes
import subprocess
from functools import cache
from pathlib import Path

from firmware_sim.guard import parameters as module
from firmware_sim.guard.parameters import GuardParameters
from firmware_sim.guard.reference import Stream

SOURCE = Path(module.__file__).parent
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffreestanding")


class _Message(ctypes.Structure):
    _fields_ = [
        ("can_id", ctypes.c_uint32),
        ("patience", ctypes.c_uint16),
        ("data_ids", ctypes.c_uint8 * 16),
    ]


class _Parameters(ctypes.Structure):
    _fields_ = [
        ("messages", _Message * len(Stream)),
        *((name, ctypes.c_int32) for name in GuardParameters.__slots__[1:-1]),
        ("second_station", ctypes.c_uint8),
    ]


@cache
def library(folder: Path) -> ctypes.CDLL:
    out = folder / "guard.so"
    words = ["cc", *FLAGS, "-O2", "-shared", "-fPIC", SOURCE / "guard.c", "-o", out]
    subprocess.run([str(word) for word in words], check=True)
    found = ctypes.CDLL(str(out))
    found.guard_tick.restype = ctypes.c_uint8
    found.guard_receive.argtypes = [
        ctypes.c_void_p, ctypes.c_uint32, ctypes.c_char_p, ctypes.c_uint8,
    ]  # fmt: skip
    return found


class GuardInC:
    """As `Guard`."""

    def __init__(self, parameters: GuardParameters, folder: Path) -> None:
        self._library = library(folder)
        messages = [
            _Message(each.can_id, each.patience, (ctypes.c_uint8 * 16)(*each.data_ids))
            for each in parameters.messages
        ]
        numbers = [getattr(parameters, name) for name in GuardParameters.__slots__[1:]]
        self._parameters = _Parameters((_Message * len(Stream))(*messages), *numbers)
        self._state = ctypes.create_string_buffer(4096)
        self._library.guard_start(self._state, ctypes.byref(self._parameters))

    def receive(self, can_id: int, data: bytes) -> None:
        self._library.guard_receive(self._state, can_id, data, len(data))

    def tick(self) -> int:
        return int(self._library.guard_tick(self._state))
