"""State and alarms as registers of Modbus TCP, read by function 3 or 4; any other is refused."""

import asyncio
import math
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from struct import pack, unpack
from typing import Final

from utank_hil.canbus import AlarmState, Fault, Mode

NOT_AVAILABLE: Final = 0x8000  #: Least of 16 signed bits, which no value has.
FIRST_ALARM: Final = 100  #: Register of fault code 0.
_READS: Final = (3, 4)
_READ_BYTES: Final = 5  #: Of a request to read: function, first register, number.
_MOST_READ: Final = 125  #: Registers in one answer.
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_HEAD_BYTES: Final = 7
_MOST_BYTES: Final = 254  #: Of device number, function and data.
_MOST_CLIENTS: Final = 32
_START_S: Final = 10.0  #: Time in which the server listens, even on a busy machine.


@dataclass(slots=True)
class State:
    """What the registers show."""

    row: Mapping[str, float]  #: The latest telemetry row; empty without a fresh one.
    alarms: Mapping[Fault, AlarmState]
    life: int
    complete: bool  #: Whether no event of the alarm list was lost.


def _signal(name: str, unit: float = 1.0) -> Callable[[State], int]:
    def value(state: State) -> int:
        shown = state.row.get(name, math.nan) / unit
        return round(max(-32767.0, min(32767.0, shown))) if math.isfinite(shown) else NOT_AVAILABLE

    return value


def _waiting(state: State) -> int:
    return sum(each is not AlarmState.ACTIVE_ACKNOWLEDGED for each in state.alarms.values())


REGISTERS: Final[Mapping[str, Callable[[State], int]]] = {
    "life counter: one more for each look (0.5 s) with news of the controller, 65535 then 0": (
        lambda state: state.life
    ),
    f"mode: {', '.join(f'{mode.value} {mode.name}' for mode in Mode)}": _signal("mode"),
    "roll, 0.01°, starboard down positive": _signal("roll_rad", math.radians(0.01)),
    "pressure commanded, 10 Pa": _signal("pressure_command_pa", 10.0),
    "pressure measured, 10 Pa": _signal("pressure_actual_pa", 10.0),
    "code of the latched fault; in INIT of what is awaited": _signal("fault"),
    "alarms in the list": lambda state: len(state.alarms),
    "of these not acknowledged": _waiting,
    "1: the alarm list is complete; 0: changes were lost": lambda state: state.complete,
}  #: Value of each register by its meaning, from address 0 on.


def values(state: State) -> dict[int, int]:
    """Return the value of each register by its address, 16 bits each."""
    found = {at: int(each(state)) & 0xFFFF for at, each in enumerate(REGISTERS.values())}
    for code in range(max(Fault) + 1):
        alarm = state.alarms.get(Fault(code)) if code in set(Fault) else None
        found[FIRST_ALARM + code] = 0 if alarm is None else alarm + 1
    return found


def reply(request: bytes, shown: Mapping[int, int]) -> bytes:
    """Return the answer to a request, both from the function's code on, without device number."""
    function, problem = request[0], _ILLEGAL_FUNCTION
    if function in _READS:
        start, count = unpack(">HH", request[1:]) if len(request) == _READ_BYTES else (0, 0)
        if not 1 <= count <= _MOST_READ:
            problem = _ILLEGAL_VALUE
        elif all(at in shown for at in range(start, start + count)):
            found = [shown[at] for at in range(start, start + count)]
            return pack(f">BB{count}H", function, 2 * count, *found)
        else:
            problem = _ILLEGAL_ADDRESS
    return bytes([function | 0x80, problem])


class ModbusServer:
    """Serves registers from a thread of its own; OSError if the address can't be listened at."""

    def __init__(self, address: tuple[str, int], state: State) -> None:
        self._values = values(state)
        self._clients: list[StreamWriter] = []
        self._stop: Callable[[], object] = lambda: None
        self._failure: OSError | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(address,), daemon=True)
        self._thread.start()
        if not self._ready.wait(_START_S) or self._failure is not None:
            raise OSError(
                f"modbus://{address[0]}:{address[1]}: {self._failure or 'no server in time'}; "
                "is the port in use, or below 1024?"
            )

    def show(self, state: State) -> None:
        """Serve these values from now on."""
        self._values = values(state)

    def close(self) -> None:
        """End the server and its connections; idempotent."""
        with suppress(RuntimeError):  # Its loop has ended.
            self._stop()
        self._thread.join(_START_S)

    def _serve(self, address: tuple[str, int]) -> None:
        try:
            asyncio.run(self._served(address))
        except OSError as error:  # The constructor reports it.
            self._failure = error
            self._ready.set()

    async def _served(self, address: tuple[str, int]) -> None:
        loop, stop = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._answer, *address)
        self._stop = lambda: loop.call_soon_threadsafe(stop.set)
        self._ready.set()
        await stop.wait()
        server.close()
        for client in self._clients:
            client.transport.abort()
        while self._clients:  # else Python 3.11 prints that each was cancelled
            await asyncio.sleep(0)

    async def _answer(self, reader: StreamReader, client: StreamWriter) -> None:
        """Answer a client until it goes, or sends what is no Modbus."""
        self._clients.append(client)
        if len(self._clients) > _MOST_CLIENTS:  # One whose end was not heard must keep no place.
            self._clients.pop(0).transport.abort()
        try:
            with suppress(OSError, asyncio.IncompleteReadError):
                while True:
                    head = await reader.readexactly(_HEAD_BYTES)
                    transaction, protocol, length, device = unpack(">HHHB", head)
                    if protocol != 0 or not 2 <= length <= _MOST_BYTES:
                        break
                    answer = reply(await reader.readexactly(length - 1), self._values)
                    client.write(pack(">HHHB", transaction, 0, len(answer) + 1, device) + answer)
                    await client.drain()
        finally:  # or the end would wait for it for ever
            if client in self._clients:
                self._clients.remove(client)
            client.close()
