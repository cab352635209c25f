"""Every reader of files gets whole files that are damaged: a result, or an error in plain words.

Each row of `READERS` makes a small file and reads it; `OTHERS` are files of other programs, where
they are. What is drawn is up to three mutations: flipped bits, a cut, doubled, swapped or inserted
blocks, other numbers. A reader then returns a result or raises an error of this project that names
the file. It writes nothing to standard error, leaves no file open, ends within `MOST_S` and takes
no more than `MOST_MB`; a log still has what stands before the damage.

In `make test` each reader gets 25 files, or a share of them where its library is slow; `make
search` draws 200 new ones. ``UTANK_HIL_MUTATIONS`` is another number: with 300000 `make search`
reads ten million, in some two days of a processor.
"""

import gzip
import json
import os
import re
import shutil
import signal
import traceback
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import reload
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from others import others_file

from firmware_sim.campaign.study import load_study
from firmware_sim.fmu_file import FmuFile
from firmware_sim.scenario import Scenario
from utank_hil.commands.commissioning_record import why_not_commissioned
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.configuration.device_files import Eds, _dbc_layouts
from utank_hil.configuration.files import ALLOW_CODE
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.configuration.matrices import read_system
from utank_hil.sea.measured import load_directional
from utank_hil.sea.moment_table import MomentTable
from utank_hil.sea.ndbc import load_ndbc
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.replay import entries_of
from utank_hil.telemetry.ring import RingReader, RingWriter
from utank_hil.telemetry.signal_files import read_signals, write_signals

ROOT = Path(__file__).resolve().parents[1]
OWN = ("utank_hil", "firmware_sim")
MOST_S, MOST_MB = 20, 700
EXAMPLES = int(os.environ.get("UTANK_HIL_MUTATIONS", settings.default.max_examples))
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
WRONG = [
    b"nan",
    b"inf",
    b"1e308",
    b"-1",
    b"0",
    b"99999999999999999999",
    b"1e-320",
    b"",
    b"2147483647",
]
FMU_VARIABLES = ("roll_rad", "roll_rate_rad_s", "level_m", "flow_m3_s", "wave_moment_nm")
CONTROLLER = ROOT / "configs" / "controllers" / "gpc.yaml"


class Reader(NamedTuple):
    """A kind of file: its name, how it is made and read, and for how many files one counts."""

    name: str
    make: Callable[[Path], object]
    read: Callable[[Path], Any]
    cost: int = 1
    streamed: bool = False  #: What is read is a list, and `notes` say what is left out.


def frames(path: Path) -> tuple[list[Any], list[str]]:
    notes: list[str] = []
    return list(BusLog(path).frames(notes)), notes


def records(path: Path) -> tuple[list[Any], list[str]]:
    notes: list[str] = []
    return [tuple(each) for each in entries_of(FrameLog(path).blocks(notes.append))], notes


def ring(path: Path) -> object:
    shared = Path("/dev/shm") / f"utank-mutated-{os.getpid()}"
    shutil.copyfile(path, shared)
    try:
        with RingReader(shared.name) as reader:
            return reader.ended, reader.read()
    except OSError as error:
        raise ValueError(f"{path.name}: {error}") from error
    finally:
        shared.unlink()


def commissioned(path: Path) -> object:
    why = why_not_commissioned(load_config(CONTROLLER, ControllerConfig), "can0", CONTROLLER, path)
    assert not why or path.name in why
    return why


def fmu(path: Path) -> object:
    pressure = {"file": str(path), "variables": dict.fromkeys(FMU_VARIABLES, "p")}
    try:
        return FmuFile.model_validate(pressure, context={ALLOW_CODE: True})
    except ValueError as error:
        if "can't be used" in str(error):
            raise ValueError(str(error).splitlines()[1]) from error
        return error  # It was read, and lacks a variable.


def candump(lines: int = 40) -> bytes:
    rows = (
        f"({1e9 + i / 50:.6f}) can0 08FF1080#0102030405060{i % 10:X}0{i % 8} R\n"
        for i in range(lines)
    )
    return "".join(rows).encode()


def made_log(path: Path) -> None:
    """Write a log in any format that has a writer."""
    if path.suffix == ".frames":
        shutil.copyfile(ROOT / "tests" / "replay" / "drive-fault.frames", path)
        return
    import can
    import can.io.mf4
    import can.io.trc

    writers = {".asc": can.ASCWriter, ".blf": can.BLFWriter, ".trc": can.io.trc.TRCWriter}
    writer = writers.get(path.suffix) or reload(can.io.mf4).MF4Writer
    with writer(path) as log:
        for i in range(40):
            log.on_message_received(
                can.Message(1.78e9 + i / 64, 0x8FF1080, data=bytes([i] * 8), channel=1, is_rx=True)
            )


def made_savvycan(path: Path) -> None:
    head = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
    rows = (f"{20000 * i},08FF1080,true,Rx,0,2,00,{i:02X},\n" for i in range(40))
    path.write_text(head + "".join(rows))


def made_ndbc(path: Path) -> None:
    hz = np.arange(0.03, 0.4, 0.01)
    head = "#YY  MM DD hh mm " + " ".join(f"{each:.4f}" for each in hz)
    rows = [
        f"2019 02 {d:02} 00 40 " + " ".join(f"{each * d:.2f}" for each in hz) for d in range(1, 9)
    ]
    path.write_text("\n".join([head, *rows, ""]))


def made_netcdf(path: Path) -> None:
    from sea.test_directional import written

    shutil.move(written(path.parent), path)


def made_moments(path: Path) -> None:
    rows = (f"{w / 10},{b},{w * b}e3,{w}\n" for w in range(3, 9) for b in range(0, 181, 30))
    path.write_text("omega_rad_s,heading_deg,moment_nm_per_m,phase_deg\n" + "".join(rows))


LAW = {
    "A": [[0.5, 0.1], [0.0, 0.2]],
    "B": [[1.0], [0.5]],
    "C": [[1.0, 0.0]],
    "D": [[0.0]],
    "dt": 0.2,
}


def made_law(path: Path) -> None:
    if path.suffix == ".json":
        path.write_text(json.dumps(LAW))
    elif path.suffix == ".npz":
        np.savez(path, **LAW)
    elif path.name == "v73.mat":
        import h5py

        with h5py.File(path, "w", userblock_size=512) as file:
            for name, value in LAW.items():
                file[name] = np.atleast_2d(value).T
    else:
        from scipy.io import savemat

        savemat(path, LAW, do_compression=path.name == "packed.mat")


def made_signals(path: Path) -> None:
    time_s = np.arange(300) * 0.1
    names = ("roll_rad", "roll_rate_rad_s", "level_m", "pressure_command_pa")
    write_signals(path, {"time_s": time_s} | {name: np.sin(time_s + 0.1) for name in names})


def made_rrd(path: Path) -> None:
    from utank_hil.telemetry.recording import write_recording

    rows = np.random.default_rng(1).normal(size=(50, 2))
    rows[:, 0] = np.arange(50) * 0.1
    write_recording(path, ["time_s", "roll_rad"], {"a": rows}, about={"version": "1"})


def made_ring(path: Path) -> None:
    from utank_hil.telemetry.ring import RingKind

    with RingWriter(RingKind.ROWS, 16, 1, 8, {"columns": ["a", "b"]}) as writer:
        for i in range(12):
            writer.write(np.array([i, -i], dtype=float))
        shutil.copyfile(Path("/dev/shm") / writer.name, path)


def made_fmu(path: Path) -> None:
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="a" '
        'guid="b"><CoSimulation modelIdentifier="a"/><ModelVariables><ScalarVariable name="p" '
        'valueReference="0" causality="input"><Real start="0"/></ScalarVariable></ModelVariables>'
        "<ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)


def made_record(path: Path) -> None:
    record = {"commissioned_for": {"ship": {"a": 1}}, "passed": True, "ended": "", "bus": "can0"}
    path.write_text(json.dumps(record | {"date": "2026", "checks": [{"verdict": "pass"}]}))


def copied(name: str) -> Callable[[Path], object]:
    """Return what copies a file of this project, its names of others made absolute."""

    def make(path: Path) -> None:
        file = ROOT / name
        text = file.read_text(encoding="utf-8")
        if file.suffix == ".yaml":
            text = re.sub(
                r"\.\.?/[\w./]+", lambda found: str((file.parent / found[0]).resolve()), text
            )
        path.write_text(text, encoding="utf-8")

    return make


def configured(model: Any) -> Callable[[Path], object]:
    return lambda path: load_config(path, model)


EDS = """[FileInfo]\nFileName=a.eds\n[DeviceInfo]\nVendorName=a\n[1000]\nParameterName=type
DataType=0x7\nDefaultValue=0x191\n[1800sub1]\nDefaultValue=$NODEID+0x180\n[1800sub2]
DefaultValue=255\n[1A00sub0]\nDefaultValue=1\n[1A00sub1]\nDefaultValue=0x60000010\n[6000]
DataType=0x6\n"""
READERS = [
    Reader("a.log", lambda path: path.write_bytes(candump()), frames, streamed=True),
    Reader("a.log.gz", lambda path: path.write_bytes(gzip.compress(candump())), frames),
    Reader("a.asc", made_log, frames, streamed=True),
    Reader("a.trc", made_log, frames, streamed=True),
    Reader("savvy.csv", made_savvycan, frames, streamed=True),
    Reader("a.blf", made_log, frames),
    Reader("a.mf4", made_log, frames, cost=5),
    Reader("a.frames", made_log, records, cost=5, streamed=True),
    Reader("a.csv", made_signals, read_signals),
    Reader("a.parquet", made_signals, read_signals),
    Reader("a.rrd", made_rrd, read_signals, cost=5),
    Reader("41010w2019.txt", made_ndbc, load_ndbc),
    Reader("a.nc", made_netcdf, load_directional, cost=12),
    Reader("moments.csv", made_moments, MomentTable.read),
    *(
        Reader(name, made_law, read_system)
        for name in ("law.json", "law.npz", "law.mat", "packed.mat", "v73.mat")
    ),
    Reader("a.fmu", made_fmu, fmu),
    Reader("a.ring", made_ring, ring),
    Reader("a.commissioning.json", made_record, commissioned, cost=2),
    Reader("a.eds", lambda path: path.write_text(EDS), lambda path: Eds(str(path)).sent(1)),
    Reader(
        "a.dbc", copied("utank_hil/canbus/utank.dbc"), lambda path: _dbc_layouts(str(path)), cost=12
    ),
    Reader("ship.yaml", copied("configs/ships/patti_b.yaml"), configured(Vessel)),
    Reader("controller.yaml", copied("configs/controllers/gpc.yaml"), configured(ControllerConfig)),
    Reader("scenario.yaml", copied("configs/scenarios/patti_b.yaml"), configured(Scenario), cost=2),
    Reader("study.yaml", copied("configs/studies/storm_seeds.yaml"), load_study, cost=5),
    Reader(
        "hull.nc",
        lambda path: shutil.copyfile(ROOT / "tests/dynamics/data/wigley.nc", path),
        read_hull,
        cost=5,
    ),
]
OTHERS = {
    "hulls/wamit-fpso/fpso.1": lambda path: read_hull(path, Given(density_kg_m3=1025.0)),
    "hulls/aqwa-cylinder/cylinder.AH1": read_hull,
    "hulls/nemoh3-cylinder/Nemoh.cal": read_hull,
    "hulls/nemoh3-cylinder/results/ExcitationForce.tec": lambda path: read_hull(
        path.parents[1] / "Nemoh.cal"
    ),
    "hulls/shipx-supply/input.re7": read_hull,
    "hulls/shipx-supply/supply.mat": read_hull,
    "seas/41010.data_spec": load_ndbc,
    "seas/41010w2019part.txt.gz": load_ndbc,
    "seas/swanfile.spec": load_directional,
    "seas/ww3station.spec": load_directional,
    "seas/spotter_20180214.json": load_directional,
    "seas/era5file.nc": lambda path: load_directional(path, (72.0, 0.0)),
    "devices/frames/n2k-two-attitudes.candump.log": frames,
    "logs/test_CanMessage.asc.gz": frames,
    "logs/test_CanFdMessage64.asc": frames,
    "logs/test_CanMessage.blf": frames,
    "logs/test_CanMessage_V1_1.trc": frames,
    "devices/dbc/sbgCan.dbc": lambda path: _dbc_layouts(str(path)),
    "devices/eds/lely-simple.eds": lambda path: Eds(str(path)).sent(1),
    "decay/kvlcc2_21337.csv": read_signals,
}
MUTATION = st.tuples(
    st.sampled_from(["flip", "cut", "double", "swap", "insert", "number", "count"]),
    st.integers(0, 1 << 20),
    st.integers(1, 400),
    st.integers(0, 1 << 16),
)


def mutated(content: bytes, mutations: list[tuple[str, int, int, int]]) -> bytes:
    """Return a content with these mutations; places are in parts of 2^20 of its length."""
    for kind, part, size, value in mutations:
        at = part * len(content) >> 20
        head, block, tail = content[:at], content[at : at + size], content[at + size :]
        if kind == "flip" and block:
            content = head + bytes([block[0] ^ 1 << value % 8]) + block[1:] + tail
        elif kind == "cut":
            content = head
        elif kind == "double":
            content = head + block * (1 + value % 7) + tail
        elif kind == "swap":
            content = head + tail[:size] + block + tail[size:]
        elif kind == "insert":
            content = head + value.to_bytes(3, "little") * (size % 9) + block + tail
        elif kind == "number" and (found := NUMBER.search(content, at)):
            content = content[: found.start()] + WRONG[value % len(WRONG)] + content[found.end() :]
        elif kind == "count" and len(block) >= 4:
            huge = (b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0" * 4, b"\0\0\0\x10")[value % 4]
            content = head + huge + block[4:] + tail
    return content


@contextmanager
def within(seconds: int, what: str) -> Iterator[None]:
    """Fail where it takes longer, in this process and what it waits for."""

    def late(*_: object) -> None:
        pytest.fail(f"{what}: not done after {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def status_mb(key: str) -> int:
    return int(re.search(rf"{key}:\s+(\d+)", Path("/proc/self/status").read_text())[1]) >> 10


def attempt(path: Path, read: Callable[[Path], Any]) -> Any:
    """Return the result of a reader; None for an error in the project's words, checked here."""
    result, words, place = None, path.name, str(ROOT)
    try:
        with within(MOST_S, path.name):
            result = read(path)
    except (ValueError, OSError) as error:
        words, place = repr(error), traceback.extract_tb(error.__traceback__)[-1].filename
        if isinstance(error, OSError) or type(error).__module__.startswith(OWN):
            place = str(ROOT)
    assert str(ROOT) in place, words
    assert path.name in words
    links = (f"/proc/self/fd/{each}" for each in os.listdir("/proc/self/fd"))
    left = [os.readlink(each) for each in links if os.path.islink(each)]
    assert not [each for each in left if str(path.parent) in each]
    return result


def tried(path: Path, read: Callable[[Path], Any], capfd: Any, cost: int, streamed: bool) -> None:
    """Read a file, then its mutations."""
    whole = path.read_bytes()

    @settings(max_examples=max(1, EXAMPLES // cost), phases=(Phase.generate, Phase.shrink))
    @given(st.lists(MUTATION, min_size=1, max_size=3))
    def holds(mutations: list[tuple[str, int, int, int]]) -> None:
        content = mutated(whole, mutations)
        path.write_bytes(content)
        result = attempt(path, read)
        if streamed and result is not None:
            same = next(
                (i for i, (a, b) in enumerate(zip(whole, content, strict=False)) if a != b),
                min(len(whole), len(content)),
            )
            _nothing_lost(path, read, first[0], result, same, whole)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The commands print none of a library's.
        first = attempt(path, read)
        assert first is not None, f"{path} can't be read"
        Path("/proc/self/clear_refs").write_text("5")  # VmHWM starts anew.
        before_mb = status_mb("VmRSS")
        holds()
        assert status_mb("VmHWM") - before_mb < MOST_MB
    path.write_bytes(whole)
    assert capfd.readouterr().err == ""


def _nothing_lost(
    path: Path, read: Callable[[Path], Any], first: list[Any], result: Any, same: int, whole: bytes
) -> None:
    """What stands before the first damaged byte is found; what is not, is said."""
    path.write_bytes(whole[: whole.rfind(b"\n", 0, same) + 1 if path.suffix != ".frames" else same])
    intact = attempt(path, read)
    found, notes = result
    if intact is not None:
        assert found[: len(intact[0])] == intact[0] == first[: len(intact[0])]
    assert notes or len(found) >= len(intact[0] if intact else [])


@pytest.mark.parametrize("reader", READERS, ids=lambda each: each.name)
def test_a_damaged_file_is_read_or_refused_in_words(
    reader: Reader, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / reader.name
    reader.make(path)
    tried(path, reader.read, capfd, reader.cost, reader.streamed)


@pytest.mark.parametrize("name", OTHERS)
def test_a_damaged_file_of_others_is_read_or_refused_in_words(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    theirs = others_file(name)
    folder = shutil.copytree(theirs.parent, tmp_path / "copy") if "hulls" in name else tmp_path
    path = folder / Path(name).name
    if name.count("/") == 3:  # Results stand below the file that is read.
        shutil.copytree(theirs.parents[1], tmp_path / "whole")
        path = tmp_path / "whole" / Path(*Path(name).parts[2:])
    else:
        shutil.copyfile(theirs, path)
    tried(path, OTHERS[name], capfd, 12, streamed=False)
