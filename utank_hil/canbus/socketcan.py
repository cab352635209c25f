"""SocketCAN through python-can, as a `Port`.

No notifier thread and no periodic transmission by the kernel: the loop reads the socket at the
start of its tick and sends at the end, so a loop that hangs is silent on the bus.
"""

import errno
import re
import socket
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from utank_hil.canbus.frame import CHECK_BUS, LONGEST_ID, STANDARD, Frame, PortError
from utank_hil.canbus.line_names import LINE_REMEDY, LINES, SERIAL_REMEDY, SLCAN
from utank_hil.canbus.python_can import SocketcanBus, can
from utank_hil.canbus.sentence_line import STRANGER, SentenceLine

#: More than the kernel's receive buffer (about 280 frames); bounds the time on a babbling bus.
MAX_FRAMES_PER_CALL: Final = 320
#: A deleted interface: its sockets never recover, even if the interface is created again.
_GONE: Final = (errno.ENODEV, errno.ENXIO)
_CREATE: Final = "plug in the adapter, or create the interface; a vcan0 without root: tools/vcan"
_REMEDIES: Final = {
    errno.ENETDOWN: "bring it up: ip link set {channel} up",
    errno.ENOBUFS: "transmit queue full: no node acknowledges, or the bus is overloaded",
    errno.EAFNOSUPPORT: "the kernel has no CAN: modprobe can_raw",
}
#: Error classes of <linux/can/error.h> after which no frame is transmitted.
_ERROR_CLASSES: Final = {
    0x001: "transmit timeout",
    0x010: "transceiver fault",
    0x020: "no node acknowledges",
    0x040: "bus-off",
}
_CONTROLLER_PROBLEM: Final = 0x004
# their details, in the second data byte; a warning level (0x04, 0x08) is counted only
_CONTROLLER_PROBLEMS: Final = {
    0x01: "receive buffer overflow",
    0x02: "transmit buffer overflow",
    0x10: "error-passive on receiving",
    0x20: "error-passive on sending",
}
_SYSFS, _CAN_TYPE = Path("/sys/class/net"), "280"  # ARPHRD_CAN, an interface's own word
_NUMBER: Final = re.compile(r"\[Errno -?[0-9]+\] | \[Error Code -?[0-9]+\]")


def open_bus(
    name: str,
    filters: list[can.typechecking.CanFilter] | None = None,
    *,
    listens: bool = False,
    emulates: bool = False,
) -> can.BusABC:
    """A CAN interface, a serial adapter that `listens` without acknowledging, or a line.

    Of a line it is the sensor's end that `emulates`. PortError is raised if there is none.
    """
    try:
        if name.startswith(LINES):
            return SentenceLine(name, sends=emulates)
        if name.startswith(SLCAN):
            from utank_hil.canbus.slcan import SerialBus  # here: pyserial need not be there

            return SerialBus(name, listens=listens, can_filters=filters)
        if why := _why_none(name):  # python-can leaks its socket if it can't bind it
            raise _worded(name, why, _create(), errno.ENODEV)
        return SocketcanBus(name, receive_own_messages=False, can_filters=filters)
    except PortError:
        raise
    except (can.CanError, OSError, ValueError) as error:
        raise port_error(name, error) from error


def port_error(channel: str, error: Exception) -> PortError:
    """What is wrong with an interface or line, with the remedy."""
    number = getattr(error, "error_code", None) or getattr(error, "errno", None)
    said = _NUMBER.sub("", getattr(error, "strerror", None) or str(error))
    if channel.startswith(LINES):
        return _worded(channel, said, LINE_REMEDY)
    if channel.startswith(SLCAN):
        return _worded(channel, said, SERIAL_REMEDY)
    remedy = _create() if number in _GONE else _REMEDIES.get(number or 0, CHECK_BUS)
    return _worded(channel, said, remedy, number)


def _worded(channel: str, what: str, remedy: str, number: int | None = None) -> PortError:
    kind = "line" if channel.startswith(LINES) else "CAN interface"
    text = f"{kind} {channel}: {what}; {remedy.format(channel=channel)}"
    return PortError(text) if number is None else PortError(number, text)


def _why_none(name: str) -> str:
    """Why a name is none of a CAN interface; empty if it is one, or that can't be told."""
    try:
        socket.if_nametoindex(name)
    except OSError:
        return "not found"
    return "is no CAN interface" if _type(name) not in ("", _CAN_TYPE) else ""


def _type(name: str) -> str:
    with suppress(OSError):
        return Path(_SYSFS, name, "type").read_text(encoding="ascii").strip()
    return ""


def _create() -> str:
    there = sorted(each.name for each in _SYSFS.glob("*") if _type(each.name) == _CAN_TYPE)
    return f"there is {', '.join(there)}; {_CREATE}" if there else _CREATE


class SocketCanPort:
    """A SocketCAN interface, a serial adapter (`SLCAN`) or a line; see `Port` for what it does.

    An interface that was down is used again when it is up. One that was deleted is reopened by the
    first call after it exists again; until then, or if there never was one, calls raise PortError.
    `can_ids` is an acceptance filter of extended identifiers in the kernel. Frames with identifiers
    of 11 bits are only counted unless they are `standard`. On a line (`LINES`) only who `emulates`
    its sensor sends.
    """

    def __init__(
        self,
        channel: str,
        can_ids: Iterable[int] | None = None,
        *,
        standard: bool = False,
        receive_only: bool = False,
        emulates: bool = False,
    ) -> None:
        self.channel, self._emulates = channel, emulates
        self._line = channel.startswith(LINES)
        self._standard, self._receive_only = standard, receive_only or self._line > emulates
        self.others = 0  #: Received frames of all other kinds.
        self._filters: list[can.typechecking.CanFilter] | None = None
        if can_ids is not None:
            self._filters = [
                {"can_id": can_id, "can_mask": LONGEST_ID, "extended": True} for can_id in can_ids
            ]
        self._down = self._drained = False
        self._pending: PortError | None = None
        self._closed = False
        self._bus: can.BusABC | None = None
        self._open_bus()

    def send(self, frame: Frame) -> None:
        """Queue one frame; see `Port.send`."""
        bus = self._open_bus()
        if self._receive_only:
            raise self._port_error("receive-only by the ship's file", "nothing is sent there")
        standard = frame.can_id & STANDARD
        message = can.Message(
            arbitration_id=frame.can_id & LONGEST_ID, is_extended_id=not standard, data=frame.data
        )
        try:
            bus.send(message)
        except (can.CanError, OSError) as error:
            raise self._failure(error) from error
        self._down = False

    def receive(self) -> Sequence[Frame]:
        """At most `MAX_FRAMES_PER_CALL` frames; an error beside some is raised by the next call."""
        frames = self._read() if self._pending is None else []
        if self._pending is not None:
            if not frames:
                try:
                    raise self._pending  # held by a variable here it would never be freed
                finally:
                    self._pending = None
        elif frames:
            if self._drained:
                self._down = False
        elif self._down:
            # the kernel reports it only once, and later reads look like a quiet bus
            self._drained = True
            raise self._port_error("interface down", _REMEDIES[errno.ENETDOWN])
        return frames

    def _read(self) -> list[Frame]:
        """Frames; the first error that came with them is pending."""
        bus = self._open_bus()
        frames: list[Frame] = []
        for _ in range(MAX_FRAMES_PER_CALL):
            try:
                # not recv(0), which uses the wall clock and blocks when that is set back
                message, _filtered = bus._recv_internal(0)
            except (can.CanError, OSError) as error:
                failure = self._failure(error)
                self._pending = self._pending or failure
                break
            if message is None:
                break
            if message.is_error_frame:
                problem = self._problem(message)
                self._pending = self._pending or problem
            elif message.is_remote_frame or not (message.is_extended_id or self._standard):
                self.others += 1
            else:
                can_id = message.arbitration_id | (0 if message.is_extended_id else STANDARD)
                frames.append(Frame(can_id, bytes(message.data)))
        return frames

    def close(self) -> None:
        """Release the socket; idempotent."""
        self._closed = True
        self._close_bus()

    def _close_bus(self) -> None:
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _open_bus(self) -> can.BusABC:
        if self._closed:
            raise self._port_error("closed", "open a new port")
        if self._bus is None:
            self._bus = open_bus(self.channel, self._filters, emulates=self._emulates)
        return self._bus

    def _problem(self, message: can.Message) -> PortError | None:
        """Count an error frame; the error that it stands for, None if it only warns."""
        self.others += 1
        classes = message.arbitration_id
        if classes == STRANGER:
            return self._port_error("there is another sender than its own", "nothing of it is read")
        detail = message.data[1] if classes & _CONTROLLER_PROBLEM and len(message.data) > 1 else 0
        for bits, meanings in ((classes, _ERROR_CLASSES), (detail, _CONTROLLER_PROBLEMS)):
            for bit, meaning in meanings.items():
                if bits & bit:
                    return self._port_error(meaning, CHECK_BUS)
        return None

    def _failure(self, error: can.CanError | OSError) -> PortError:
        number = getattr(error, "error_code", None) or getattr(error, "errno", None)
        if self._line or self.channel.startswith(SLCAN):
            with suppress(can.CanError, OSError):  # its port may be gone
                self._close_bus()
            self._bus = None
        elif number in _GONE:
            self._close_bus()
        elif number == errno.ENETDOWN:
            self._down, self._drained = True, False  # frames of before may still be queued
        return port_error(self.channel, error)

    def _port_error(self, what: str, remedy: str) -> PortError:
        return _worded(self.channel, what, remedy)
