"""Files are there whole or not at all, on a full disk too."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from little_room import ROOM, little_room

from utank_hil.base.whole_file import left_whole, write_whole
from utank_hil.pictures.report_page import write_report_page
from utank_hil.pictures.style import picture
from utank_hil.telemetry.recording import write_recording


def a_text(path: Path) -> None:
    write_whole(path, "0123456789" * ROOM)


def a_recording(path: Path) -> None:
    rows = np.random.default_rng(1).standard_normal((2000, 2))
    write_recording(path, ["time_s", "roll_rad"], {"passive": rows})


def a_picture(path: Path) -> None:
    with picture(path, "Noise", (4.0, 3.0)) as figure:
        figure.add_subplot().plot(np.random.default_rng(1).standard_normal(500))


def a_page(path: Path) -> None:
    write_report_page(path, "Storm", "seed 1", [], [])


@pytest.mark.parametrize("write", [a_text, a_recording, a_picture, a_page])
def test_what_does_not_fit_is_named_and_not_left_in_half(
    tmp_path: Path, write: Callable[[Path], None]
) -> None:
    path = tmp_path / "file"
    write(path)
    assert path.stat().st_size > ROOM
    with little_room(), pytest.raises(OSError, match=str(path)):
        write(path)
    assert not path.exists()


def test_what_is_interrupted_is_not_left_in_half(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with pytest.raises(KeyboardInterrupt), left_whole(path):  # noqa: PT012
        path.write_text("ha")
        raise KeyboardInterrupt
    assert not path.exists()


def test_a_file_that_must_not_be_written_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_path: Path, _content: bytes) -> int:
        raise PermissionError(13, "Permission denied")

    path = tmp_path / "page.html"
    path.write_text("mine")
    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(PermissionError, match=str(path)):
        write_whole(path, "text")
    assert path.read_text() == "mine"


def test_a_full_device_stays_and_is_named() -> None:
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        write_whole(Path("/dev/full"), "text")
    assert Path("/dev/full").exists()
