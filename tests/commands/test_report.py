"""The report of a recording, read back from its page; that of a bench is in tests/firmware_sim."""

import base64
import importlib
import io
import json
import math
import re
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from PIL import Image
from ports import QuietBus
from typer.testing import CliRunner

from utank_hil.base.provenance import describe
from utank_hil.canbus.enumerations import AlarmState, Fault, Mode
from utank_hil.cli import app
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.signals import SIGNALS
from utank_hil.pictures import report_page
from utank_hil.pictures.report_page import ReportSection, ReportTable, Verdict, write_report_page
from utank_hil.reports import page as pages
from utank_hil.reports import recording as of_recording
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.frame_log import EVENTS, ROWS, FrameLogWriter
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.run_log import _packed

pytestmark = pytest.mark.slow


def write_page(recording: Path, page: Path) -> Path:
    """What the command does."""
    return write_report_page(page, *of_recording.recording_report(recording))


ACTIVE_FROM_S, FAULT_FROM_S, END_S = 20.0, 200.0, 240.0

ALARM = {
    "time_ns": int(1e9 * FAULT_FROM_S), "code": int(Fault.LEVEL_LIMIT),
    "state": int(AlarmState.ACTIVE_UNACKNOWLEDGED), "mode": int(Mode.FAULT),
}  # fmt: skip


def write_log(
    file: Path, rows: np.ndarray, about: dict[str, Any], events: Sequence[dict[str, Any]] = ()
) -> Path:
    """The log of a run."""
    with FrameLogWriter(file, {"about": about, "columns": SIGNALS}) as log:
        log.append(ROWS, _packed(rows))
        log.append(EVENTS, json.dumps(events).encode())
    return file


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.targets += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was in charge and then stopped on a full reservoir."""
    folder = tmp_path_factory.mktemp("log")
    time_s = np.arange(0.0, END_S, 0.01)
    rows = np.zeros((len(time_s), len(SIGNALS)))

    def fill(name: str, values: object) -> None:
        rows[:, SIGNALS.index(name)] = values

    fill("time_s", time_s)
    fill("roll_rad", 0.03 * np.sin(0.5 * time_s))
    fill("twin_roll_rad", 0.06 * np.sin(0.5 * time_s + 1.0))
    fill("starboard_level_m", np.sin(0.5 * time_s))
    fill("mode", np.where(time_s < ACTIVE_FROM_S, Mode.STANDBY, Mode.ACTIVE))
    fill("fault", np.where(time_s < FAULT_FROM_S, Fault.NONE, Fault.LEVEL_LIMIT))
    rows[time_s >= FAULT_FROM_S, SIGNALS.index("mode")] = Mode.FAULT
    config = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
    about = describe("run", config, folder, options={"bus": "can0"})
    return write_log(folder / "run-20260101T000000Z.frames", rows, about, [ALARM])


@pytest.fixture(scope="module")
def page(recording: Path) -> Path:
    """The page that the command makes of it."""
    page = recording.with_name("page.html")
    done = CliRunner().invoke(app, ["report", str(recording), "--out", str(page), "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"page": str(page), "bytes": page.stat().st_size}
    return page


@pytest.fixture
def one_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of reports cost no time where only the words matter."""

    def drawn(*given: object) -> Path:
        (file,) = (each for each in given if isinstance(each, Path))
        Image.new("L", (1, 1)).save(file)
        return file

    monkeypatch.setattr("utank_hil.reports.page.draw_roll_statistics", drawn)
    monkeypatch.setattr(of_recording, "draw_bench", drawn)


def test_the_page_of_a_recording_says_what_happened(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    rms = math.degrees(0.03 / math.sqrt(2))
    assert f"{rms:.2f}° RMS, 50% less than the {2 * rms:.2f}° of its passive twin" in text
    assert "In charge for 75% of the time" in text
    assert 'class="verdict bad"' in text
    assert fault_text(Fault.LEVEL_LIMIT).partition(": ")[2] in text
    assert "ACTIVE_UNACKNOWLEDGED" in text
    for begin, mode in ((0.0, "STANDBY"), (20.0, "ACTIVE"), (200.0, "FAULT")):
        assert re.search(rf"{begin:.1f} s</td><td[^>]*>{mode}<", text)
    assert "kind: gpc" in text  # the whole configuration


@pytest.mark.evidence
@pytest.mark.usefixtures("one_pixel")
def test_the_log_of_a_run_has_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    words = ["run", "configs/controllers/gpc.yaml", "--bus", "any0", "--duration", "0.5"]
    assert CliRunner().invoke(app, [*words, "--out", str(tmp_path)]).exit_code == 0
    (file,) = tmp_path.glob("run-*.frames")
    page = write_page(file, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "The controller was never in charge." in page


def test_a_folder_is_refused_and_says_what_to_name(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["report", str(tmp_path)])
    assert done.exit_code == 2
    assert "name a log" in " ".join(done.output.split())


def of_roll(path: Path, roll_rad: np.ndarray) -> Path:
    """A recording of a law in charge throughout, whose passive twin rolls twice as much."""
    rows = np.zeros((len(roll_rad), len(SIGNALS)))
    for name, values in (
        ("time_s", 0.05 * np.arange(len(roll_rad))),
        ("roll_rad", roll_rad),
        ("twin_roll_rad", 2 * roll_rad),
        ("mode", Mode.ACTIVE),
    ):
        rows[:, SIGNALS.index(name)] = values
    config = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
    return write_log(path, rows, describe("run", config, path.parent, options={}))


@pytest.mark.usefixtures("one_pixel")
def test_gaps_in_the_roll_are_left_out_of_its_figures(tmp_path: Path) -> None:
    roll = 0.03 * np.sin(0.5 * 0.05 * np.arange(5000))
    roll[:10] = roll[1000:1500] = np.nan
    page = write_page(of_roll(tmp_path / "a.frames", roll), tmp_path / "a.html").read_text()
    rms = math.degrees(math.sqrt(np.nanmean(roll**2)))
    assert f"{rms:.2f}° RMS, 50% less than the {2 * rms:.2f}° of its passive twin" in page
    assert "the roll is known for 89.8% of it" in page
    page = write_page(
        of_roll(tmp_path / "b.frames", np.nan * roll), tmp_path / "b.html"
    ).read_text()
    assert "In charge for 100% of the time: the roll is not known." in page


def test_what_no_report_can_be_made_of_is_refused(tmp_path: Path) -> None:
    one = of_roll(tmp_path / "one.frames", np.array([0.1]))
    with pytest.raises(ValueError, match=r"one\.frames: 1 rows are too few for a report"):
        write_page(one, tmp_path / "page.html")
    bench = tmp_path / "bench.rrd"
    write_recording(bench, SIGNALS, {"passive": np.zeros((9, len(SIGNALS)))})
    with pytest.raises(ValueError, match=r"bench\.rrd: is no frame log"):
        write_page(bench, tmp_path / "page.html")


def test_the_page_needs_nothing_else_and_is_whole(page: Path) -> None:
    assert page.stat().st_size < 5e6
    text = page.read_text(encoding="utf-8")
    links = _Links()
    links.feed(text)
    assert links.open == []
    assert "http" not in text.replace("https://", "http://").split("<details>")[0]
    assert len(links.targets) == 2  # the histories, and the roll's spectra and exceedance
    for target in links.targets:
        kind, _, content = target.partition(",")
        assert kind == "data:image/png;base64"
        image = matplotlib.image.imread(io.BytesIO(base64.b64decode(content)), format="png")
        assert np.std(image[..., :3]) > 0.05


def test_cells_are_escaped(tmp_path: Path) -> None:
    table = ReportTable(["", "<b>"], [["a & b", "<script>"]])
    section = ReportSection("<i>", ["<u>"], tables=[table], listings={"<x>": "<y>"})
    page = write_report_page(
        tmp_path / "a.html", "<t>", "<a>", [Verdict(["<v>"], good=True)], [section]
    ).read_text(encoding="utf-8")
    for text in ("<b>", "<script>", "<i>", "<u>", "<x>", "<y>", "<t>", "<a>", "<v>"):
        assert text not in page.partition("<body>")[2]
    assert 'class="verdict"' in page


@pytest.mark.usefixtures("one_pixel")
def test_a_recording_of_another_version_is_named(tmp_path: Path) -> None:
    file = tmp_path / "old.frames"
    rows = np.zeros((100, len(SIGNALS)))
    rows[:, SIGNALS.index("time_s")] = np.arange(100)
    write_log(file, rows, {"configuration": {"name": "a law"}})
    with pytest.raises(
        ValueError, match=r"old\.frames: has no 'machine': it is of another version"
    ):
        write_page(file, tmp_path / "page.html")


@pytest.mark.usefixtures("one_pixel")
def test_a_folder_for_the_page_is_made(recording: Path, tmp_path: Path) -> None:
    for out in (tmp_path, tmp_path / "new" / "pages"):
        done = CliRunner().invoke(app, ["report", str(recording), "--out", str(out), "--json"])
        assert json.loads(done.stdout)["page"] == str(out / "report.html")
        assert (out / "report.html").stat().st_size > 1000


@pytest.mark.usefixtures("one_pixel")
def test_a_full_disk_is_said_with_the_page_and_leaves_no_half_of_it(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = CliRunner().invoke(app, ["report", str(recording), "--out", "/dev/full"])
    assert done.exit_code == 2
    assert isinstance(done.exception, SystemExit)
    assert "/dev/full: No space left on device" in done.output
    assert Path("/dev/full").exists()

    def half(path: Path, *_arguments: object, **_more: object) -> None:
        path.touch()
        raise OSError(28, "No space left on device")

    page = tmp_path / "page.html"
    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(OSError, match="No space left"):
        write_page(recording, page)
    assert not page.exists()


@pytest.mark.parametrize(
    ("name", "expected"),
    [("nothing.frames", "nothing.frames"), ("text.frames", "text.frames")],
)
def test_what_is_no_run_is_named(tmp_path: Path, name: str, expected: str) -> None:
    (tmp_path / "text.frames").write_text("no recording")
    with pytest.raises((ValueError, OSError)) as caught:
        write_page(tmp_path / name, tmp_path / "page.html")
    assert expected in str(caught.value)
    assert str(tmp_path / name) in str(caught.value)


def test_a_page_of_several_runs_leaves_that_of_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        importlib.import_module("firmware_sim.commands.report"), "_report", lambda run: run
    )
    monkeypatch.setattr(pages, "joined", lambda runs: runs)

    def written(file: Path, *runs: Path) -> Path:
        file.write_text(" and ".join(each.name for each in runs))
        return file

    monkeypatch.setattr(report_page, "write_report_page", written)
    for name in ("calm", "storm"):
        (tmp_path / name).mkdir()
        assert CliRunner().invoke(app, ["report", str(tmp_path / name)]).exit_code == 0
    both = [str(tmp_path / name) for name in ("calm", "storm")]
    assert CliRunner().invoke(app, ["report", *both]).exit_code == 0
    assert (tmp_path / "calm" / "report.html").read_text() == "calm"
    assert (tmp_path / "calm-and-1-more.html").read_text() == "calm and storm"
