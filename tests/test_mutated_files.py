"""Every reader of files gets whole files that are damaged: a result, or an error in plain words.

Each row of `READERS` makes a small file and reads it; `OTHERS` are files of other programs, where
they are. What is drawn is up to three mutations: flipped bits, a cut, doubled, swapped or inserted
blocks, other numbers. A reader then returns a result or raises an error of this project that names
the file. It writes nothing to standard error, leaves no file open, ends within `MOST_S` and takes
no more than `MOST_MB`; a log still has what stands before the damage.

In `make test` each reader gets 25 files, or a share of them where its library is slow; `make
search` draws 200 new ones. `make test-all` reads ten million, each the same every time by its
reader and number; ``UTANK_HIL_MUTATIONS`` is another number of all, or a part: ``3e6:4e6``.
"""

import gzip
import json
import os
import random
import re
import shutil
import signal
import struct
import traceback
import warnings
import zipfile
import zlib
from collections.abc import Callable
from contextlib import contextmanager
from importlib import reload
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from others import others_file
from pydantic import ValidationError
from telemetry.bus_files.test_formats import blf, blf_message

from firmware_sim.campaign.axes import Draws
from firmware_sim.campaign.store import METRICS, Store, read_results
from firmware_sim.campaign.study import load_study
from firmware_sim.fmu_file import FmuFile
from firmware_sim.scenario import Scenario
from utank_hil.analysis.motion.decay import roll_decay
from utank_hil.analysis.motion.inclining import inclining
from utank_hil.base.parameters import ParameterError
from utank_hil.commands.commissioning_record import why_not_commissioned
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.configuration.device_files import Eds, _dbc_layouts
from utank_hil.configuration.files import ALLOW_CODE
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.configuration.matrices import read_system
from utank_hil.configuration.spectra import TabulatedSpectrum
from utank_hil.sea import Sea, jonswap
from utank_hil.sea.components import read_components, write_components
from utank_hil.sea.measured import load_directional
from utank_hil.sea.moment_table import MomentTable
from utank_hil.sea.ndbc import load_ndbc
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.frame_log import EVENTS, ROWS, FrameLog, FrameLogWriter
from utank_hil.telemetry.replay import entries_of
from utank_hil.telemetry.replay_head import ReplayHeadError, causes, recorded_config
from utank_hil.telemetry.ring import RingReader, RingWriter
from utank_hil.telemetry.run_log import _packed, read_run_log
from utank_hil.telemetry.signal_files import read_signals, require, write_signals

ROOT = Path(__file__).resolve().parents[1]
OWN = ("utank_hil", "firmware_sim")
MOST_S, MOST_MB = 20, 700
MEMORY = Path("/dev/shm")
FILES = [float(each) for each in os.environ.get("UTANK_HIL_MUTATIONS", "0:1e7").split(":")]
KINDS = ("flip", "cut", "double", "swap", "insert", "number", "count")
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
    """A kind of file: its name, how it is made and read, and the ms that takes, as drawn here."""

    name: str
    make: Callable[[Path], object]
    read: Callable[[Path], Any]
    cost: float = 1
    streamed: bool = False  #: What is read is a list, and `notes` say what is left out.


def frames(path):
    notes: list[str] = []
    return list(BusLog(path).frames(notes)), notes


def records(path):
    notes: list[str] = []
    return [tuple(each) for each in entries_of(FrameLog(path).blocks(notes.append))], notes


def ring(path):
    shared = MEMORY / f"utank-mutated-{os.getpid()}"
    shutil.copyfile(path, shared)
    try:
        with RingReader(shared.name) as reader:
            return reader.ended, reader.read()
    except OSError as error:
        raise ValueError(f"{path.name}: {error}") from error
    finally:
        shared.unlink()


def commissioned(path):
    why = why_not_commissioned(load_config(CONTROLLER, ControllerConfig), "can0", CONTROLLER, path)
    assert not why or path.name in why
    return why


def fmu(path):
    pressure = {"file": str(path), "variables": dict.fromkeys(FMU_VARIABLES, "p")}
    try:
        return FmuFile.model_validate(pressure, context={ALLOW_CODE: True})
    except ValueError as error:
        if "can't be used" in str(error):
            raise ValueError(str(error).splitlines()[1]) from error
        return error  # It was read, and lacks a variable.


def wrapped(path, name, content, read):
    """Read a content in the container in which readers find it; errors name that."""
    whole = path.parent / name
    whole.write_bytes(content)
    try:
        return read(whole)
    except ValueError as error:
        why = f"{path.name}: {error}" if name in str(error) else f"without {name}: {error}"
        raise ValueError(why) from error
    finally:
        whole.unlink()


def described(path):
    with zipfile.ZipFile(path.with_name("a.fmu"), "w") as archive:
        archive.writestr("modelDescription.xml", path.read_bytes())
    return wrapped(path, "a.fmu", path.with_name("a.fmu").read_bytes(), fmu)


def objects(path):
    return wrapped(path, "a.blf", blf(path.read_bytes()), frames)


def replayable(path):
    def read(log):
        head = FrameLog(log).head
        try:
            with recorded_config(head) as config:
                return config, causes(head, config, path.parent)
        except (ReplayHeadError, ParameterError) as error:
            raise ValueError(f"{log}: {error}") from error

    body = zlib.compress(path.read_bytes(), 1)
    size = struct.pack("<4sII", b"HEAD", len(body), zlib.crc32(body, zlib.crc32(b"HEAD")))
    return wrapped(path, "a.frames", b"UTANKHIL frames 1\n" + size + body, read)


def made_head(path):
    log = FrameLog(ROOT / "tests" / "replay" / "motion-silent.frames")
    path.write_text(json.dumps(log.head))


def made_objects(path):
    path.write_bytes(b"".join(blf_message(1_000_000 * i) for i in range(20)))


def of_a_test(find, *names):
    """Return what reads a test's record and evaluates it, as `identify` does."""

    def read(path):
        (run,) = read_signals(path).values()
        require(path, run, *names)
        try:
            return find(*(run[name] for name in names))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error

    return read


def made_decay(path):
    time_s = np.arange(0.0, 60.0, 0.2)
    roll_rad = 0.2 * np.exp(-0.03 * time_s) * np.cos(0.9 * time_s)
    roll_decay(time_s, roll_rad)  # It is compiled here.
    write_signals(path, [{"time_s": time_s, "roll_rad": roll_rad}])


def made_inclining(path):
    moment_nm = np.array([0.0, 1e5, 2e5, 0.0, -1e5, -2e5, 0.0])
    write_signals(path, [{"moment_nm": moment_nm, "heel_rad": moment_nm * 1e-7 + 1e-4}])


def nemoh_results(path):
    try:
        return read_hull(path.parents[1] / "Nemoh.cal")
    except ValueError as error:  # What fails in the whole is of the main file.
        raise ValueError(f"{path.name}: {error}") from error


def candump(lines=12):
    rows = (
        f"({1e9 + i / 50:.6f}) can0 08FF1080#0102030405060{i % 10:X}0{i % 8} R\n"
        for i in range(lines)
    )
    return "".join(rows).encode()


def made_log(path):
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


def made_savvycan(path):
    head = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
    rows = (f"{20000 * i},08FF1080,true,Rx,0,2,00,{i:02X},\n" for i in range(40))
    path.write_text(head + "".join(rows))


def made_ndbc(path):
    hz = np.arange(0.03, 0.4, 0.01)
    head = "#YY  MM DD hh mm " + " ".join(f"{each:.4f}" for each in hz)
    rows = [
        f"2019 02 {d:02} 00 40 " + " ".join(f"{each * d:.2f}" for each in hz) for d in range(1, 9)
    ]
    path.write_text("\n".join([head, *rows, ""]))


def made_netcdf(path):
    from sea.test_directional import written

    shutil.move(written(path.parent), path)


def made_moments(path):
    rows = (f"{w / 10},{b},{w * b}e3,{w}\n" for w in range(3, 9) for b in range(0, 181, 30))
    path.write_text("omega_rad_s,heading_deg,moment_nm_per_m,phase_deg\n" + "".join(rows))


def made_components(path):
    write_components(Sea.irregular(jonswap(4.0, 10.0), 1, components=30), path)


LAW = {
    "A": [[0.5, 0.1], [0.0, 0.2]],
    "B": [[1.0], [0.5]],
    "C": [[1.0, 0.0]],
    "D": [[0.0]],
    "dt": 0.2,
}


def made_law(path):
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


def made_signals(path):
    time_s = np.arange(300) * 0.1
    names = ("roll_rad", "roll_rate_rad_s", "level_m", "pressure_command_pa")
    write_signals(path, [{"time_s": time_s} | {name: np.sin(time_s + 0.1) for name in names}])


def made_rrd(path):
    from utank_hil.telemetry.recording import write_recording

    rows = np.random.default_rng(1).normal(size=(50, 2))
    rows[:, 0] = np.arange(50) * 0.1
    write_recording(path, ["time_s", "roll_rad"], {"a": rows}, about={"version": "1"})


def made_ring(path):
    from utank_hil.telemetry.ring import RingKind

    with RingWriter(RingKind.ROWS, 16, 1, 8, {"columns": ["a", "b"]}) as writer:
        for i in range(12):
            writer.write(np.array([i, -i], dtype=float))
        shutil.copyfile(MEMORY / writer.name, path)


def made_fmu(path):
    text = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="a" '
        'guid="b"><CoSimulation modelIdentifier="a"/><ModelVariables><ScalarVariable name="p" '
        'valueReference="0" causality="input"><Real start="0"/></ScalarVariable></ModelVariables>'
        "<ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)


def made_record(path):
    record = {"commissioned_for": {"ship": {"a": 1}}, "passed": True, "ended": "", "bus": "can0"}
    path.write_text(json.dumps(record | {"date": "2026", "checks": [{"verdict": "pass"}]}))


def copied(name):
    """Return what copies a file of this project, its names of others made absolute."""

    def make(path):
        file = ROOT / name
        text = file.read_text(encoding="utf-8")
        if file.suffix == ".yaml":
            text = re.sub(
                r"\.\.?/[\w./]+", lambda found: str((file.parent / found[0]).resolve()), text
            )
        path.write_text(text, encoding="utf-8")

    return make


def configured(model):
    return lambda path: load_config(path, model)


def made_description(path):
    made_fmu(path)
    with zipfile.ZipFile(path) as archive:
        content = archive.read("modelDescription.xml")
    path.write_bytes(content)


def made_sea(path):
    rows = (f"{hz / 50},{hz % 7 / 2}\n" for hz in range(2, 20))
    path.write_text("frequency_hz,density_m2_hz\n" + "".join(rows))


def section(model, path, **content):
    """Return a section that names a file; the configuration says which key that is."""
    try:
        return model(**content)
    except ValidationError as error:
        raise ValueError(f"{path.name}: {error.errors()[0]['msg']}") from error


def tabulated(path):
    return section(TabulatedSpectrum, path, kind="tabulated", file=path)


def dbc(path):
    return _dbc_layouts.__wrapped__(str(path))  # Not what was kept of the whole file.


def drawn(path):
    return section(Draws, path, samples=3, table=path).samples_drawn()


def made_campaign(path):
    """Write the folder of a campaign with one case of two runs."""
    about = {
        "keys": ["a"], "configuration": {"simulation": "linear"}, "machine": {}, "options": {},
        "data": {}, "program": "a", "version": "1", "commit": "c", "date": "2026", "command": "a",
    } | {"machine": {"platform": "a", "python": "3", "cpus": 2}}  # fmt: skip
    loaded = SimpleNamespace(path=CONTROLLER, cases=[SimpleNamespace(
        name="a", index=0, waves="w", parameters={"a": 1.5})])  # fmt: skip
    store = Store(path.parent)
    store.begin(loaded, about, resume=True)  # what it takes of a study
    row = {"case": "a", "status": "ok", "reason": "", "mark": "", "wall_s": 1.0}
    store.write([row | {"run": run} | dict.fromkeys(METRICS, 0.5) for run in ("passive", "b")])


def made_events(path):
    event = {"time_ns": 1, "code": 3, "state": 1, "mode": 2, "received": "a", "start_ns": 5}
    path.write_text(json.dumps([event | {"time_ns": i} for i in range(9)]))


def events(path):
    """Read the events of a run's log."""
    log = path.with_name("whole.frames")
    with FrameLogWriter(log, {"about": {}, "columns": ["time_s", "x"]}) as written:
        written.append(ROWS, _packed(np.zeros((3, 2))))
        written.append(EVENTS, path.read_bytes())
    return wrapped(path, "a.frames", log.read_bytes(), lambda log: read_run_log(log).events)


EDS = """[FileInfo]\nFileName=a.eds\n[DeviceInfo]\nVendorName=a\n[1000]\nParameterName=type
DataType=0x7\nDefaultValue=0x191\n[1800sub1]\nDefaultValue=$NODEID+0x180\n[1800sub2]
DefaultValue=255\n[1A00sub0]\nDefaultValue=1\n[1A00sub1]\nDefaultValue=0x60000010\n[6000]
DataType=0x6\n"""
READERS = [
    Reader("a.log", lambda path: path.write_bytes(candump()), frames, streamed=True, cost=0.6),
    Reader("a.log.gz", lambda path: path.write_bytes(gzip.compress(candump())), frames, cost=0.4),
    Reader("a.asc", made_log, frames, streamed=True),
    Reader("a.trc", made_log, frames, streamed=True, cost=0.9),
    Reader("savvy.csv", made_savvycan, frames, streamed=True, cost=0.8),
    Reader("a.blf", made_log, frames, cost=0.3),
    Reader("a.mf4", made_log, frames, cost=200),  # As law.mat below.
    Reader("a.frames", made_log, records, streamed=True, cost=0.7),
    Reader("a.csv", made_signals, read_signals, cost=2),
    Reader("a.parquet", made_signals, read_signals, cost=2),
    Reader("a.rrd", made_rrd, read_signals, cost=1300),
    Reader("41010w2019.txt", made_ndbc, load_ndbc),
    Reader("a.nc", made_netcdf, load_directional, cost=16),
    Reader("moments.csv", made_moments, MomentTable.read, cost=0.4),
    Reader("sea.csv", made_components, read_components, cost=0.4),
    *(Reader(name, made_law, read_system, cost=0.5) for name in ("law.json", "law.npz")),
    Reader("v73.mat", made_law, read_system, cost=5),  # A damaged head makes it one of those below.
    # A process of its own reads it, as scipy's reader may end with a segmentation fault.
    *(Reader(name, made_law, read_system, cost=200) for name in ("law.mat", "packed.mat")),
    Reader("a.fmu", made_fmu, fmu, cost=0.6),
    Reader("a.ring", made_ring, ring, cost=0.4),
    Reader("a.commissioning.json", made_record, commissioned, cost=7),
    Reader(
        "a.eds", lambda path: path.write_text(EDS), lambda path: Eds(str(path)).sent(1), cost=0.7
    ),
    Reader("a.dbc", copied("utank_hil/canbus/utank.dbc"), dbc, cost=18),
    Reader("ship.yaml", copied("configs/ships/patti_b.yaml"), configured(Vessel), cost=1.6),
    Reader(
        "controller.yaml",
        copied("configs/controllers/gpc.yaml"),
        configured(ControllerConfig),
        cost=1.4,
    ),
    Reader("scenario.yaml", copied("configs/scenarios/patti_b.yaml"), configured(Scenario), cost=4),
    Reader("study.yaml", copied("configs/studies/storm_seeds.yaml"), load_study, cost=7),
    Reader("model.xml", made_description, described),
    Reader("objects.bin", made_objects, objects, cost=0.5),
    Reader("head.json", made_head, replayable, cost=2),
    Reader("decay.csv", made_decay, of_a_test(roll_decay, "time_s", "roll_rad"), cost=1.5),
    Reader(
        "inclining.csv",
        made_inclining,
        of_a_test(lambda m, h: inclining(m, h, 1.9e7), "moment_nm", "heel_rad"),
        cost=0.6,
    ),
    Reader("sea.csv", made_sea, tabulated, cost=0.3),
    Reader("climate.csv", copied("configs/seas/climate_northern_north_sea.csv"), drawn, cost=1.6),
    Reader("cases.parquet", made_campaign, lambda path: read_results(path.parent), cost=2),
    Reader("study.json", made_campaign, lambda path: read_results(path.parent), cost=0.5),
    Reader("events.json", made_events, events, cost=0.3),
    Reader(
        "hull.nc",
        lambda path: shutil.copyfile(ROOT / "tests/dynamics/data/wigley.nc", path),
        read_hull,
        cost=20,
    ),
]
OTHERS: dict[str, tuple[Callable[[Path], Any], float]] = {
    "hulls/wamit-fpso/fpso.1": (lambda path: read_hull(path, Given(density_kg_m3=1025.0)), 10),
    "hulls/aqwa-cylinder/cylinder.AH1": (read_hull, 3),
    "hulls/nemoh3-cylinder/Nemoh.cal": (read_hull, 6),
    "hulls/nemoh3-cylinder/results/ExcitationForce.tec": (nemoh_results, 11),
    "hulls/shipx-supply/input.re7": (read_hull, 18),
    "hulls/shipx-supply/supply.mat": (read_hull, 200),
    "seas/41010.data_spec": (load_ndbc, 16),
    "seas/41010w2019part.txt.gz": (load_ndbc, 2),
    "seas/swanfile.spec": (load_directional, 2),
    "seas/ww3station.spec": (load_directional, 1.3),
    "seas/spotter_20180214.json": (load_directional, 3),
    "seas/era5file.nc": (lambda path: load_directional(path, (72.0, 0.0)), 17),
    "devices/frames/n2k-two-attitudes.candump.log": (frames, 26),
    "logs/test_CanMessage.asc.gz": (frames, 0.4),
    "logs/test_CanFdMessage64.asc": (frames, 0.3),
    "logs/test_CanMessage.blf": (frames, 0.3),
    "logs/test_CanMessage_V1_1.trc": (frames, 0.4),
    "devices/dbc/sbgCan.dbc": (dbc, 7),
    "devices/eds/lely-simple.eds": (lambda path: Eds(str(path)).sent(1), 1.3),
    "decay/kvlcc2_21337.csv": (read_signals, 11),
}
MUTATION = st.tuples(
    st.sampled_from(KINDS), st.integers(0, 1 << 20), st.integers(1, 400), st.integers(0, 1 << 16)
)


def mutated(content, mutations):
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
def within(seconds, what):
    """Fail where it takes longer, in this process and what it waits for."""

    def late(*_):
        pytest.fail(f"{what}: not done after {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def status_mb(key):
    return int(re.search(rf"{key}:\s+(\d+)", Path("/proc/self/status").read_text())[1]) >> 10


def attempt(path, read):
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
    assert path.name in words, words
    links = (f"/proc/self/fd/{each}" for each in os.listdir("/proc/self/fd"))
    left = [os.readlink(each) for each in links if os.path.islink(each)]
    assert not [each for each in left if str(path.parent) in each]
    return result


class Trial:
    """Reads a file, then its mutations."""

    def __init__(self, path, read, streamed):
        self.path, self.read, self.streamed = path, read, streamed
        self.whole = path.read_bytes()
        self.first = attempt(path, read)
        assert self.first is not None, f"{path} can't be read"

    def one(self, mutations):
        content = mutated(self.whole, mutations)
        self.path.write_bytes(content)
        result = attempt(self.path, self.read)
        if self.streamed and result is not None:
            pairs = enumerate(zip(self.whole, content, strict=False))
            least = min(len(self.whole), len(content))
            same = next((i for i, (a, b) in pairs if a != b), least)
            _nothing_lost(self.path, self.read, self.first[0], result, same, self.whole)


@contextmanager
def trial(path, read, capfd, streamed):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The commands print none of a library's.
        begun = Trial(path, read, streamed)
        Path("/proc/self/clear_refs").write_text("5")  # VmHWM starts anew.
        before_mb = status_mb("VmRSS")
        yield begun
        assert status_mb("VmHWM") - before_mb < MOST_MB
    path.write_bytes(begun.whole)
    said = capfd.readouterr().err.splitlines()
    assert not [line for line in said if "newer than the local Rerun" not in line]


def _nothing_lost(path, read, first, result, same, whole):
    """What stands before the first damaged byte is found; what is not, is said."""
    path.write_bytes(whole[: whole.rfind(b"\n", 0, same) + 1 if path.suffix != ".frames" else same])
    intact = attempt(path, read)
    found, notes = result
    if intact is not None:
        assert found[: len(intact[0])] == intact[0] == first[: len(intact[0])]
    assert notes or len(found) >= len(intact[0] if intact else [])


KINDS_OF_FILES = {each.name: each for each in READERS} | {
    name: Reader(name, others_file, read, cost) for name, (read, cost) in OTHERS.items()
}


def placed(reader, folder):
    """Make the file of a reader in a folder, or copy that of others with what it needs."""
    path = folder / Path(reader.name).name
    if reader.name not in OTHERS:
        reader.make(path)
        return path
    theirs = others_file(reader.name)
    if "hulls" not in reader.name:
        shutil.copyfile(theirs, path)
        return path
    root = theirs.parents[reader.name.count("/") - 2]  # Results may stand below the file read.
    shutil.copytree(root, folder / "copy")
    return folder / "copy" / theirs.relative_to(root)


@pytest.fixture
def folder():
    """A folder in memory, where there is one: ext4 writes a file that is replaced to the disk."""
    with TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as path:
        yield Path(path)


@pytest.mark.parametrize("name", KINDS_OF_FILES)
def test_a_damaged_file_is_read_or_refused_in_words(name, folder, capfd):
    reader = KINDS_OF_FILES[name]
    examples = max(1, int(settings.default.max_examples // max(1, reader.cost)))
    with trial(placed(reader, folder), reader.read, capfd, reader.streamed) as begun:

        @settings(max_examples=examples, phases=(Phase.generate, Phase.shrink))
        @given(st.lists(MUTATION, min_size=1, max_size=3))
        def holds(mutations):
            begun.one(mutations)

        holds()


@pytest.mark.parametrize(
    ("name", "mutation"),
    [
        ("law.mat", ("flip", 568277, 367, 59197)),
        ("a.mf4", ("flip", 251259, 284, 62286)),
    ],
)
def test_a_file_that_ends_its_librarys_process_is_refused(name, mutation, folder, capfd):
    reader = KINDS_OF_FILES[name]
    with trial(placed(reader, folder), reader.read, capfd, reader.streamed) as begun:
        begun.one([mutation])


def test_a_time_beyond_the_processors_integers_is_refused_in_words(folder, capfd):
    reader = KINDS_OF_FILES["41010w2019.txt"]
    with trial(placed(reader, folder), reader.read, capfd, reader.streamed) as begun:
        begun.one([("number", 244472, 135, 65389), ("number", 602173, 22, 32720)])


@pytest.mark.parametrize(
    ("name", "mutations"),
    [
        ("seas/era5file.nc", [("double", 69244, 32, 57656), ("double", 717954, 315, 53301),
                              ("count", 6808, 95, 18743)]),
        ("seas/swanfile.spec", [("number", 19578, 236, 27887), ("swap", 288383, 102, 26574),
                                ("flip", 389911, 192, 43982)]),
        ("devices/dbc/sbgCan.dbc", [("number", 927101, 185, 33968), ("number", 693527, 235, 42656),
                                    ("number", 598963, 169, 6209)]),
        ("cases.parquet", [("double", 459508, 316, 57540), ("flip", 319600, 163, 35671)]),
    ],
    ids=["axis of another name", "more lines than there are", "signal beyond all", "column"],
)  # fmt: skip
def test_what_ten_million_found_is_refused_in_words(name, mutations, folder, capfd):
    reader = KINDS_OF_FILES[name]
    with trial(placed(reader, folder), reader.read, capfd, reader.streamed) as begun:
        begun.one(mutations)


@pytest.mark.evidence
@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", KINDS_OF_FILES)
def test_ten_million_damaged_files_are_read_or_refused_in_words(name, folder, capfd):
    reader = KINDS_OF_FILES[name]
    whole = sum(1 / each.cost for each in KINDS_OF_FILES.values())
    with trial(placed(reader, folder), reader.read, capfd, reader.streamed) as begun:
        first, last = (int(each / reader.cost / whole) for each in ([0.0, *FILES])[-2:])
        for number in range(first, last + 1):
            draw = random.Random(f"{name} {number}")
            mutations = [
                (draw.choice(KINDS), draw.randrange(1 << 20), draw.randint(1, 400),
                 draw.randrange(1 << 16))
                for _ in range(draw.randint(1, 3))
            ]  # fmt: skip
            try:
                begun.one(mutations)
            except BaseException as error:
                error.add_note(f"{name}, file {number}: {mutations}")
                raise
