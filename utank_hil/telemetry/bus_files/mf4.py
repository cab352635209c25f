"""Frames of a bus in MDF 4 (``.mf4``), read by python-can and asammdf."""

from collections.abc import Iterator
from importlib import reload
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from utank_hil.telemetry.bus_files.frame import BusFrame, BusLogError, of_message

MARK: Final = b"MDF "


class Mf4Log:
    """Frames of an MF4 file; BusLogError if it can't be read to its end or holds no frames."""

    def __init__(self, path: Path) -> None:
        self.notes: list[str] = []
        self._path, self._count = path, 0

    @property
    def place(self) -> str:
        """Number of the last frame."""
        return f"frame {self._count}"

    def __iter__(self) -> Iterator[BusFrame]:
        import can.io.mf4

        if find_spec("asammdf") is None:  # The reader would not name the package.
            raise ModuleNotFoundError("asammdf is not installed", name="asammdf")

        # It was imported without asammdf (`utank_hil.canbus.socketcan`).
        reader = reload(can.io.mf4).MF4Reader
        try:
            with reader(self._path) as messages:
                for message in messages:
                    self._count += 1
                    yield of_message(message, str(message.channel))
        except OSError:
            raise
        except Exception as error:  # The readers raise many kinds of exception at damaged bytes.
            raise BusLogError(
                f"{self._path}: can't be read as MF4 after frame {self._count}"
            ) from error
        if not self._count:
            raise BusLogError(f"{self._path}: no frames of a bus in it")
