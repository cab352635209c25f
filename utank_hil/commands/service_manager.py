"""Notifications to systemd by a service of ``Type=notify``: ready, alive, stopping (sd_notify)."""

import contextlib
import os
import socket
from collections.abc import Mapping
from typing import Final

from utank_hil.base.closing import Closing
from utank_hil.base.tick import TICK_NS

_FEEDS: Final = 4  #: Number of notifications within the watchdog's time.
READY_S: Final = 30.0  #: Limit of the ready notification: a third of systemd's for a start.


class ServiceManager(Closing):
    """The socket of the service manager; without one, nothing is sent.

    `environment` has ``NOTIFY_SOCKET`` and ``WATCHDOG_USEC`` as systemd sets them. Raises `OSError`
    if the socket can't be reached.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        self._every_ticks = 0
        address = environment.get("NOTIFY_SOCKET", "")
        if not address:
            return
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        try:
            self._socket.connect(address.replace("@", "\0", 1) if address[0] == "@" else address)
        except OSError:
            self.close()
            raise
        watchdog_us = environment.get("WATCHDOG_USEC", "0")
        if not watchdog_us.isdecimal():
            self.close()
            raise OSError(f"WATCHDOG_USEC={watchdog_us} is no number of microseconds")
        if watchdog_ns := 1000 * int(watchdog_us):
            self._every_ticks = max(1, watchdog_ns // (_FEEDS * TICK_NS))

    def ready(self, status: str) -> None:
        """Report that the loop begins; from here on the watchdog waits for ticks.

        A manager that misses it ends the program after a while, so this waits for a busy one;
        OSError is raised if that does not take it in time.
        """
        if self._socket is not None:
            self._socket.settimeout(READY_S)
            words = " ".join(status.split())  # Each line is an assignment.
            self._socket.send(f"READY=1\nSTATUS={words}".encode(errors="replace"))
            self._socket.setblocking(False)

    def progress(self, ticks: int) -> None:
        """Notify the watchdog of progress in the count of ticks, before each tick; never waits."""
        if self._every_ticks and ticks % self._every_ticks == 0:
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Report that the loop has ended."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Close the socket; idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is not None:
            # A busy or restarting manager misses a datagram; the next one follows.
            with contextlib.suppress(OSError):
                self._socket.send(message.encode())
