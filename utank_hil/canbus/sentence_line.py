"""A line with the sentences of a motion sensor, UDP or serial, as a bus of python-can."""

import os
import select
import socket
import termios
import tty
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, STANDARD, Frame
from utank_hil.canbus.line_names import line_of
from utank_hil.canbus.python_can import can
from utank_hil.canbus.sentences import GARBAGE, SentenceReader, sentence

STRANGER: Final = 0x1000_0000
"""Class of the error frame that tells of another sender, whose datagrams are not read."""
MOST_READ: Final = 320  #: Looks in one call that bring nothing: a flood must not hold the loop.
_BYTES: Final = 2048  #: Of one datagram, or one look at a serial port.


class SentenceLine(can.BusABC):
    """Receives; as the sensor itself, which `sends`, it only sends.

    What is no sentence comes as an error frame of no class. OSError is raised if there is no such
    line. An emulated sensor makes a pseudo terminal where its serial port is missing; what nobody
    reads there is lost.
    """

    def __init__(self, name: str, *, sends: bool = False) -> None:
        self._is_shutdown = True  # until it is open: else python-can closes it again at its end
        try:
            self._line = line = line_of(name)
        except ValueError as error:
            raise OSError(str(error)) from error
        self._sends = sends
        self._ready: deque[Frame] = deque()
        self._reader = SentenceReader()
        self._stranger = ""
        self._made: list[int] = []  # what a pseudo terminal is made of
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM) if line.sender else None
        if self._socket is not None:
            self._file = self._socket.fileno()
            self._socket.setblocking(False)
            try:
                self._socket.bind((line.sender, 0) if sends else (line.here, line.number))
            except OSError:
                self._socket.close()
                raise
        elif sends and not Path(line.here).exists():
            self._made = list(os.openpty())
            self._file = self._made[0]
            tty.setraw(self._made[1])
            os.set_blocking(self._file, False)
            Path(line.here).symlink_to(os.ttyname(self._made[1]))
        else:
            self._file = _serial_port(line.here, line.number)
        super().__init__(name)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Say the sentence that stands for a frame."""
        said = sentence(Frame(STANDARD | msg.arbitration_id, bytes(msg.data)))
        with suppress(BlockingIOError):
            if self._socket is not None:
                self._socket.sendto(said, (self._line.here, self._line.number))
            else:
                os.write(self._file, said)

    def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
        if self._sends:
            return None, False
        for _ in range(MOST_READ):
            if self._ready:
                can_id, data = self._ready.popleft()
                error = can_id in (GARBAGE, STRANGER)
                number = can_id if can_id == STRANGER else can_id & LONGEST_STANDARD_ID
                return can.Message(
                    arbitration_id=number, is_extended_id=False, is_error_frame=error, data=data
                ), False
            if timeout is None or timeout > 0:
                select.select([self._file], [], [], timeout)
                timeout = 0.0
            try:
                self._read()
            except BlockingIOError:
                break
        return None, False

    def _read(self) -> None:
        """Take what has come; BlockingIOError is raised if nothing has."""
        if self._socket is not None:
            data, (address, _) = self._socket.recvfrom(_BYTES)
            if address != self._line.sender:
                if address != self._stranger:
                    self._stranger = address
                    self._ready.append(Frame(STRANGER, b""))
                return
        else:
            data = os.read(self._file, _BYTES)
            if not data:
                raise OSError(f"{self._line.here} has hung up")
        self._ready.extend(self._reader.take(data))

    def shutdown(self) -> None:
        """Release the line; idempotent."""
        super().shutdown()
        if self._socket is not None:
            self._socket.close()
        elif self._file >= 0:
            for each in self._made or [self._file]:
                os.close(each)
            if self._made:
                Path(self._line.here).unlink(missing_ok=True)
            self._file = -1


def _serial_port(name: str, bit_rate: int) -> int:
    file = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        tty.setraw(file)  # and nothing of before is kept
        settings = termios.tcgetattr(file)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[4] = settings[5] = getattr(termios, f"B{bit_rate}")
        termios.tcsetattr(file, termios.TCSANOW, settings)
    except termios.error as error:
        os.close(file)
        raise OSError(f"{name} is no serial port: {error}") from error
    return file
