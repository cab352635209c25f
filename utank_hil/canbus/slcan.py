"""A serial adapter (LAWICEL's ASCII protocol, slcan) as a bus, by python-can."""

from typing import Any

from can import CanOperationError, Message
from can.interfaces.slcan import slcanBus

from utank_hil.canbus.line_names import tty_and_bit_rate


class SerialBus(slcanBus):
    """python-can's bus, which never waits, and passes over acknowledgements.

    A line that is no frame comes as an error frame of no class, which is counted and ends nothing.
    The adapter filters nothing, and tells neither bus-off nor missing acknowledgements.
    """

    def __init__(self, name: str, *, listens: bool = False, **options: Any) -> None:
        tty, rate = tty_and_bit_rate(name)
        super().__init__(
            tty, bitrate=rate, listen_only=listens, sleep_after_open=0,
            timeout=0.01 if listens else 0.0, **options,
        )  # fmt: skip

    def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
        while True:
            try:
                message, _ = super()._recv_internal(timeout)
            except (ValueError, IndexError, KeyError):
                return Message(is_error_frame=True), True
            except CanOperationError as error:
                if not isinstance(error.__cause__, UnicodeDecodeError):
                    raise
                self._buffer.clear()  # python-can would read it again and again
                return Message(is_error_frame=True), True
            if message is None and (self._queue.qsize() or self.serialPortOrig.in_waiting):
                continue  # an acknowledgement of what was sent
            if message is None or (not message.is_fd and self._matches_filters(message)):
                return message, True
