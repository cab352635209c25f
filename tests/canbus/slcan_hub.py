"""Adapters of the LAWICEL protocol on pseudo terminals: what one is told to send, the others hear.

Run it as a program with links to make: ``python tests/canbus/slcan_hub.py /tmp/a /tmp/b``.
"""

import os
import selectors
import signal
import sys
import threading
import tty
from contextlib import suppress
from pathlib import Path


class Hub:
    """Adapters by the names of their ports."""

    def __init__(self, count):
        self._ends = [os.openpty() for _ in range(count)]
        for controller, port in self._ends:
            tty.setraw(port)
            os.set_blocking(controller, False)
        self.ports = [os.ttyname(port) for _, port in self._ends]
        self.told: list[list[str]] = [[] for _ in self._ends]  #: Settings that each was told.
        self._rest, self._behind = [b""] * count, [b""] * count
        self._selector, self._over = selectors.DefaultSelector(), False
        for number, (controller, _) in enumerate(self._ends):
            self._selector.register(controller, selectors.EVENT_READ, number)
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._over = True
        self._thread.join()
        for each in self._ends:
            for end in each:
                os.close(end)

    def say(self, number, text):
        """Hand a text to who has opened a port, whole; lines that nobody reads are lost."""
        behind = self._behind[number]
        if len(behind) > 1 << 16:
            behind = behind[: behind.index(b"\r") + 1]  # the rest of a line that has begun
        waiting = behind + text
        with suppress(BlockingIOError):
            waiting = waiting[os.write(self._ends[number][0], waiting) :]
        self._behind[number] = waiting

    def _is_open(self, number):
        states = [each for each in self.told[number] if each in ("O", "L", "C")]
        return states[-1:] not in ([], ["C"])

    def _run(self):
        while not self._over:
            for key, _ in self._selector.select(0.02):
                self._take(key.data, os.read(key.fd, 65536))

    def _take(self, number, data):
        *lines, self._rest[number] = (self._rest[number] + data).split(b"\r")
        for line in lines:
            kind = line[:1]
            if kind not in (b"t", b"T"):
                self.told[number].append(line.decode())
                self.say(number, b"\r")
                continue
            self.say(number, b"Z\r" if kind == b"T" else b"z\r")
            for other in range(len(self._ends)):
                if other != number and self._is_open(other):
                    self.say(other, line + b"\r")


if __name__ == "__main__":
    with Hub(len(sys.argv) - 1) as hub:
        for link, port in zip(sys.argv[1:], hub.ports, strict=True):
            Path(link).unlink(missing_ok=True)
            Path(link).symlink_to(port)
        signal.sigwait((signal.SIGINT, signal.SIGTERM))
