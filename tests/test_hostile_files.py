"""Files that somebody made to do harm: none runs, hangs or fills the memory; each is refused.

A row of `ROWS` makes a file in an empty folder, names what is to read it (the words of a command,
or a reader), and what must be said. Code in a file would touch the canary ``ran``. What is said
has no signs that steer a terminal.
"""

import errno
import gzip
import io
import os
import pickle
import socket
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow
import pytest
import typer
import yaml
from packed_zeros import packed_zeros
from pyarrow import parquet
from test_mutated_files import LAW, made_fmu, ring, status_mb, within

from utank_hil.cli import app
from utank_hil.commands.commissioning_record import write_record
from utank_hil.console.common import failures_named, prepare_out
from utank_hil.console.terminal import Terminal
from utank_hil.telemetry.frame_log import FrameLogWriter
from utank_hil.telemetry.ring import RingKind, RingReader, RingWriter
from utank_hil.telemetry.rotation import make_room

ROOT = Path(__file__).resolve().parents[1]
SHIP = f"vessel: {ROOT}/configs/ships/thesis_first.yaml\n"
ESCAPE = "\x1b]0;owned\x07\x1b[2J"
MOST_S, MOST_MB, GIB = 20, 700, 1 << 30


class Canary:
    """What leaves a mark when it is unpickled."""

    def __init__(self, folder):
        self.mark = str(folder / "ran")

    def __reduce__(self):
        return os.mkdir, (self.mark,)


class Row(NamedTuple):
    """A hostile file: its name, content, what reads it, and what is said."""

    name: str
    content: "str | bytes | Callable[[Path], object]"
    words: "tuple[str, ...] | Callable[[Path], Any]"
    says: str
    code: int = 2


CHECK = ("check", "{}")
EXPORT = ("export", "{}", "--to", "{folder}/to.csv")
FRAMES = ("export", "{}", "--to", "{folder}/to.log")
REPLAY = ("replay", "{}")


def controller(law):
    return f"name: A\n{SHIP}law:\n  {law}\n"


def law_of(make, suffix):
    """Return what makes a controller's file whose law is a data file."""

    def made(path):
        file = path.with_name(f"law{suffix}")
        make(file)
        law = f"kind: state_space\n  system: ./{file.name}\n  measured: [roll_rad]"
        path.write_text(controller(law))

    return made


def law(content, suffix=".json"):
    content = content.encode() if isinstance(content, str) else content
    return law_of(lambda path: path.write_bytes(content), suffix)


def linked(to):
    return lambda path: path.symlink_to(to)


def listening(path):
    with socket.socket(socket.AF_UNIX) as own:
        here = os.getcwd()
        os.chdir(path.parent)  # A path may be longer than a socket's name.
        try:
            own.bind(path.name)
        finally:
            os.chdir(here)


def zipped(**parts):
    def make(path):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in parts.items():
                archive.writestr(name, content)

    return make


def bomb(path):
    """Write gzip of a GB and more, without a line feed in it, in a MB."""
    member = gzip.compress(b"0" * (1 << 26))
    path.write_bytes(member * 17)


def parquet_bomb(path):
    """Write 100 million numbers that are all the same."""
    table = pyarrow.table({"time_s": np.zeros(1_000_000)})
    with parquet.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(100):
            writer.write_table(table)


def wide_text(path):
    """Write a text of a MB, once, that 5000 rows have."""
    places = pyarrow.array(np.zeros(5000, dtype=np.int32))
    text = pyarrow.DictionaryArray.from_arrays(places, pyarrow.array(["x" * 1_000_000]))
    columns = {"time_s": np.arange(5000) * 0.1, "text": text}
    parquet.write_table(pyarrow.table(columns), path, store_schema=False)


def npz_bomb(path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (GIB // 8,)}
    )
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("A.npy", "w") as part,
    ):
        part.write(head.getvalue())
        for _ in range(GIB >> 24):
            part.write(bytes(1 << 24))


def object_npz(path):
    np.savez(path, A=np.array([Canary(path.parent)], dtype=object), B=[1.0], C=[1.0], D=[1.0])


def pickled(path):
    path.write_bytes(pickle.dumps({"A": Canary(path.parent)}))


def mat(**variables):
    def make(path):
        from scipy.io import savemat

        savemat(path, variables)

    return make


def mat_class(number):
    """Write a MAT file whose variable A is of another class, as 16 of a function's handle."""

    def make(path):
        mat(**LAW)(path)
        content = bytearray(path.read_bytes())
        content[144] = number
        path.write_bytes(content)

    return make


def mat_bomb(path):
    """Write a MATLAB file of 400 kB whose matrix A has 400 MB."""
    mat(A=np.zeros(1))(path)
    size = 400 << 20
    name = struct.pack("<LLLLL8s", 6, 8, 6, 0, 5, struct.pack("<ll", size // 8, 1))
    content = struct.pack("<LL", 14, size + 56) + name
    content += struct.pack("<LHH4sLL", 1, 1, 0, b"A\0\0\0", 9, size)
    packed = packed_zeros(size, content)
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<LL", 15, len(packed)) + packed)


def wide_mat(path):
    from scipy.sparse import csc_array

    mat(**(LAW | {"A": csc_array((1 << 30, 2))}))(path)


def mat_73(what):
    """Return what writes a file of MATLAB 7.3 whose matrix A is hostile."""

    def make(path):
        import h5py

        with h5py.File(path, "w", userblock_size=512) as file:
            for name in ("B", "C", "D", "dt"):
                file[name] = np.ones((1, 1))
            if what == "bomb":
                file.create_dataset("A", (1 << 15, 1 << 15), "f8", chunks=True, compression="gzip")
            elif what == "sparse":
                file.create_group("A").attrs["MATLAB_sparse"] = 1 << 40
                file["A/jc"] = np.zeros(2, dtype="u8")
            elif what == "empty":
                file["A"] = np.array([1 << 40, 0], dtype="u8")
                file["A"].attrs["MATLAB_empty"] = 1
            elif what == "external":
                file.create_dataset("A", (4, 4), "u1", external=[("/etc/passwd", 0, 16)])
            elif what == "virtual":
                layout = h5py.VirtualLayout((4, 4), "f8")
                layout[:] = h5py.VirtualSource("other.h5", "A", (4, 4))
                file.create_virtual_dataset("A", layout)
            elif what == "cycle":
                file.create_group("A")
                file["A/A"] = file["A"]
        if what == "link":
            with h5py.File(path.with_name("other.h5"), "w") as file:
                file["A"] = np.ones((1, 1))
            with h5py.File(path, "a") as file:
                file["A"] = h5py.ExternalLink("other.h5", "A")

    return make


def sparse(path):
    with path.open("wb") as file:
        file.truncate(1 << 40)


def fmu(**parts):
    """Return what makes a scenario whose ship is an FMU with further, or other, parts."""

    def make(path):
        unit = path.with_name("ship.fmu")
        made_fmu(unit)
        with zipfile.ZipFile(unit) as archive:
            whole = {name: archive.read(name) for name in archive.namelist()}
        zipped(**{**whole, **parts})(unit)
        storm = yaml.safe_load((ROOT / "configs/scenarios/patti_b.yaml").read_text())
        names = ("roll_rad", "roll_rate_rad_s", "level_m", "flow_m3_s")
        storm |= {
            "vessel": str(ROOT / "configs/ships/patti_b.yaml"),
            "controllers": {"a": str(ROOT / "configs/controllers/patti_b_constrained_gpc.yaml")},
            "plant": "fmu",
            "fmu": {"file": "./ship.fmu", "variables": dict.fromkeys(names, "p")},
        }
        path.write_text(yaml.safe_dump(storm))

    return make


ALLOWED = (*CHECK, "--allow-code")
XML = "modelDescription.xml"


def frame_log(**head):
    def make(path):
        about = {"configuration": {"name": "A"}, "data": {}}
        content = {"about": about, "files": {}, "law": {}, "packages": {}, "catalogue": 1} | head
        FrameLogWriter(path, content).close()

    return make


def block(kind, payload, length=None):
    size = len(payload) if length is None else length
    return struct.pack("<4sII", kind, size, zlib.crc32(payload, zlib.crc32(kind))) + payload


MARK = b"UTANKHIL frames 1\n"
HEAD_BOMB = MARK + block(b"HEAD", packed_zeros(GIB))


def device(content, key):
    """Return what makes a ship's file whose motion sensor is described by a DBC or EDS."""

    def make(path):
        file = path.with_name(f"a.{key}")
        if isinstance(content, bytes):
            file.write_bytes(content)
        else:
            content(file)
        ship = yaml.safe_load((ROOT / "configs/ships/thesis_first.yaml").read_text())
        ship["devices"] = {"motion": {key: f"./{file.name}", "messages": {"a": "TPDO1"}}}
        path.write_text(yaml.safe_dump(ship))

    return make


def ring_of(*words):
    return struct.pack("<16q", *words, *[0] * (16 - len(words))) + bytes(4096)


RING = int.from_bytes(b"UTNKRING", "little")


def csv_of(name):
    return f"time_s,{name}\n0,1\n0.1,2\n0.2,3\n"


# By what reads them: name, content, and what is said.
REFUSED = {
    CHECK: [
        (
            "python-object.yaml",
            "name: !!python/object/apply:os.mkdir [ran]\n",
            "not valid YAML in line 1",
        ),
        ("python-name.yaml", "name: !!python/name:os.system\n", "not valid YAML in line 1"),
        ("python-module.yaml", "name: !!python/module:antigravity\n", "not valid YAML in line 1"),
        ("own-tag.yaml", "name: !Canary x\n", "not valid YAML in line 1"),
        (
            "aliases.yaml",
            "a0: &a0 [1, 2]\n"
            + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)),
            "aliases",
        ),
        ("alias-of-itself.yaml", "a: &a [*a]\n", "names what it stands in"),
        ("merge-of-itself.yaml", "a: &a\n  <<: *a\n", "names what it stands in"),
        ("deep.yaml", "a: " + "[" * 50_000, "nested too deeply"),
        ("deep-lines.yaml", "".join(" " * i + "a:\n" for i in range(1500)), "nested too deeply"),
        ("twice.yaml", f"name: A\nname: B\n{SHIP}law: {{kind: passive}}\n", "written twice"),
        ("huge.yaml", controller("kind: pd\n  gains: [1e999, 1]"), "law"),
        ("digits.yaml", f"name: A\n{SHIP}a: {'9' * 5000}\n", "not valid YAML"),
        ("large.yaml", "name: A\n" + "#" * (1 << 23), "more than"),
        ("sparse.yaml", sparse, "can't be read"),
        ("zeros.yaml", linked("/dev/zero"), "regular file"),
        ("pipe.yaml", lambda path: os.mkfifo(path), "regular file"),
        ("socket.yaml", listening, "can't be read"),
        ("folder.yaml", lambda path: path.mkdir(), "is a folder"),
        ("loop.yaml", linked("loop.yaml"), "can't be read"),
        ("circle.yaml", "name: A\nvessel: circle.yaml\nlaw: {kind: passive}\n", "includes itself"),
        (
            "secret.yaml",
            f"name: A\nvessel: {'../' * 20}etc/passwd.yaml\nlaw: {{kind: passive}}\n",
            "No such file",
        ),
        ("null.yaml", b"name: A\0B\n", "not valid YAML"),
        ("binary.yaml", bytes(range(256)) * 9, "can't be read"),
        (
            "inner-code.yaml",
            controller(
                "kind: pump_with_valve\n  pump: {kind: python, factory: './x.py:Law', measured: [roll_rad]}"  # noqa: E501
            ),
            "law",
        ),
        (
            "code.yaml",
            controller("kind: python\n  factory: ./x.py:Law\n  measured: [roll_rad]"),
            "--allow-code",
        ),
        (
            "module.yaml",
            controller("kind: python\n  factory: os:system\n  measured: [roll_rad]"),
            "--allow-code",
        ),
        ("escape.yaml", 'name: A\n"\\e]0;owned\\a": 1\n', "error:"),
        (f"{ESCAPE}.yaml", "a: [", "not valid YAML"),
        ("pickle-npz.yaml", law_of(object_npz, ".npz"), "holds no matrices"),
        ("pickle.yaml", law_of(pickled, ".npz"), "holds no matrices"),
        ("npz-bomb.yaml", law_of(npz_bomb, ".npz"), "holds no matrices"),
        (
            "reduce.yaml",
            law('{"A": {"py/reduce": ["os.mkdir", ["ran"]]}, "B": 1, "C": 1, "D": 1, "dt": 1}'),
            "A",
        ),
        ("deep-json.yaml", law('{"A": ' + "[" * 200_000), "holds no matrices"),
        ("nan-json.yaml", law('{"A": NaN}'), "NaN is no finite number"),
        ("twice-json.yaml", law('{"A": 1, "A": 2}'), "twice"),
        ("digits-json.yaml", law('{"A": ' + "9" * 5000 + "}"), "holds no matrices"),
        ("zeros-json.yaml", law_of(linked("/dev/zero"), ".json"), "regular file"),
        ("pipe-json.yaml", law_of(lambda path: os.mkfifo(path), ".json"), "regular file"),
        ("pipe-mat.yaml", law_of(lambda path: os.mkfifo(path), ".mat"), "regular file"),
        ("sparse-json.yaml", law_of(sparse, ".json"), "more than"),
        ("handle-mat.yaml", law_of(mat_class(16), ".mat"), "law.mat"),
        ("object-mat.yaml", law_of(mat_class(17), ".mat"), "law.mat"),
        (
            "cell-mat.yaml",
            law_of(mat(**(LAW | {"A": np.array([1, "a"], dtype=object)})), ".mat"),
            "must hold numbers",
        ),
        ("text-mat.yaml", law_of(mat(**(LAW | {"A": "os.system"})), ".mat"), "must hold numbers"),
        ("bomb-mat.yaml", law_of(mat_bomb, ".mat"), "unpacks to more than"),
        ("wide-mat.yaml", law_of(wide_mat, ".mat"), "A has more than"),
        ("bomb-73.yaml", law_of(mat_73("bomb"), ".mat"), "A has more than"),
        ("wide-73.yaml", law_of(mat_73("sparse"), ".mat"), "A has more than"),
        ("empty-73.yaml", law_of(mat_73("empty"), ".mat"), "A has more than"),
        ("file-73.yaml", law_of(mat_73("external"), ".mat"), "A stands in another file"),
        ("link-73.yaml", law_of(mat_73("link"), ".mat"), "A stands in another file"),
        ("view-73.yaml", law_of(mat_73("virtual"), ".mat"), "A stands in another file"),
        ("cycle-73.yaml", law_of(mat_73("cycle"), ".mat"), "holds no matrices"),
        ("fmu-code.yaml", fmu(), "--allow-code"),
        ("dbc-zeros.yaml", device(linked("/dev/zero"), "dbc"), "regular file"),
        ("dbc-pipe.yaml", device(lambda path: os.mkfifo(path), "dbc"), "regular file"),
        ("dbc-escape.yaml", device(f'VERSION ""\nBO_ 1 {ESCAPE}: 8 A\n'.encode(), "dbc"), "error:"),
        ("dbc-sparse.yaml", device(sparse, "dbc"), "more than"),
        ("eds-pipe.yaml", device(lambda path: os.mkfifo(path), "eds"), "regular file"),
        (
            "eds-escape.yaml",
            device(f"[1800sub1]\nDefaultValue={ESCAPE}\n".encode(), "eds"),
            "error:",
        ),
        ("eds-inner.yaml", device(b"[1800sub1]\nDefaultValue=%(DefaultValue)s\n", "eds"), "error:"),
    ],
    ALLOWED: [
        ("fmu-up.yaml", fmu(**{"../../ran": "x"}), "would leave the folder"),
        ("fmu-root.yaml", fmu(**{"/tmp/ran": "x"}), "would leave the folder"),
        ("fmu-drive.yaml", fmu(**{"..\\ran": "x"}), "would leave the folder"),
        (
            "fmu-entity.yaml",
            fmu(**{XML: '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'}),
            "document type",
        ),
        (
            "fmu-laughs.yaml",
            fmu(**{XML: "<!DOCTYPE a [<!ENTITY b 'c'><!ENTITY d '&b;&b;'>]><a>&d;</a>"}),
            "document type",
        ),
        ("fmu-bomb.yaml", fmu(**{f"{i}": bytes(1 << 26) for i in range(9)}), "more than"),
        ("fmu-large.yaml", fmu(**{XML: bytes(1 << 25)}), "larger than"),
        (
            "fmu-name.yaml",
            fmu(
                **{
                    XML: '<fmiModelDescription fmiVersion="2.0" modelName="a" guid="b">'
                    '<CoSimulation modelIdentifier="../x"/></fmiModelDescription>'
                }
            ),
            "can't be used",
        ),
    ],
    EXPORT: [
        ("bomb.log.gz", bomb, "bomb.log.gz"),
        ("bomb.csv.gz", bomb, "bomb.csv.gz"),
        ("pipe.log", lambda path: os.mkfifo(path), "regular file"),
        ("pipe.csv", lambda path: os.mkfifo(path), "regular file"),
        ("pipe.rrd", lambda path: os.mkfifo(path), "regular file"),
        ("zeros.parquet", linked("/dev/zero"), "regular file"),
        ("escape.log", f"(1.5) {ESCAPE} 123#01\n(1.6) can1 123#01\n", "error:"),
        ("page.rrd", "<script>alert(1)</script>", "page.rrd"),
        ("pickle.rrd", pickled, "pickle.rrd"),
        ("pickle.parquet", pickled, "no Parquet file"),
        ("rows.parquet", parquet_bomb, "more than 40000000 values"),
        ("names.csv", "time_s," + "a" * (1 << 18) + "\n1,2\n", "names.csv"),
        ("quotes.csv", 'time_s,"' + "a\n" * (1 << 17), "quotes.csv"),
        ("escape.csv", csv_of("roll_rad") + f"0.3,{ESCAPE}\n", "is no number"),
    ],
    FRAMES: [
        ("zeros.log", linked("/dev/zero"), "regular file"),
        ("line.log", b"(1.5) can0 123#01" + b"0" * (1 << 20), "more than"),
        (
            "claims.blf",
            b"LOGG"
            + struct.pack("<L", 144)
            + bytes(136)
            + b"LOBJ"
            + struct.pack("<HHLL", 16, 1, 0xFFFFFFFF, 10),
            "claims.blf",
        ),
        (
            "blf-bomb.blf",
            b"LOGG"
            + struct.pack("<L", 144)
            + bytes(136)
            + b"LOBJ"
            + struct.pack("<HHLLH14x", 16, 1, 32 + len(packed_zeros(GIB // 4)), 10, 2)
            + packed_zeros(GIB // 4),
            "more than",
        ),
        ("not.mf4", b"MDF " + bytes(4096), "not.mf4"),
    ],
    REPLAY: [
        ("pipe.frames", lambda path: os.mkfifo(path), "regular file"),
        ("head-bomb.frames", HEAD_BOMB, "more than"),
        ("head-deep.frames", MARK + block(b"HEAD", zlib.compress(b"[" * 200_000)), "no JSON"),
        ("head-list.frames", MARK + block(b"HEAD", zlib.compress(b"[]")), "no JSON object"),
        ("head-empty.frames", MARK + block(b"HEAD", zlib.compress(b"{}")), "head-empty.frames"),
        ("head-text.frames", frame_log(about={"configuration": "a"}), "head-text.frames"),
        ("head-files.frames", frame_log(files=["a"]), "head-files.frames"),
        ("head-data.frames", frame_log(files={"../../ran": 1}), "head-data.frames"),
        (
            "code.frames",
            frame_log(
                about={
                    "configuration": {
                        "name": "A",
                        "law": {"kind": "python", "factory": "./x.py:Law"},
                    },
                    "data": {},
                }
            ),
            "must not choose",
        ),
        ("length.frames", MARK + block(b"HEAD", b"", 0xFFFFFFFF), "is cut"),
    ],
    ring: [
        ("short.ring", b"UTNKRING", "too short"),
        ("magic.ring", ring_of(1, 4, 8, 2, 8), "not a telemetry ring"),
        ("slots.ring", ring_of(RING, 4, 8, 1 << 62, 8), "not a telemetry ring"),
        ("text.ring", ring_of(RING, 4, 8, 2, -8), "not a telemetry ring"),
        ("no-slots.ring", ring_of(RING, 4, 8, 0, 8), "not a telemetry ring"),
        ("long-text.ring", ring_of(RING, 4, 8, 2, 1 << 40), "not a telemetry ring"),
        ("kind.ring", ring_of(RING, 4, 8, 2, 8), "damaged telemetry ring"),
    ],
}
ROWS = [
    Row(name, content, words, says)
    for words, rows in REFUSED.items()
    for name, content, says in rows
]
ROWS.append(Row("text.parquet", wide_text, EXPORT, "left out: text (string)", code=0))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: ascii(row.name))
def test_a_hostile_file_is_refused_in_words(row, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / row.name
    if callable(row.content):
        row.content(path)
    else:
        path.write_bytes(row.content.encode() if isinstance(row.content, str) else row.content)
    Path("x.py").write_text("from pathlib import Path\nPath('ran').mkdir()\n")
    Path("/proc/self/clear_refs").write_text("5")
    before_mb = status_mb("VmRSS")
    with within(MOST_S, row.name):
        if callable(row.words):
            with pytest.raises((ValueError, OSError)) as refused:
                row.words(path)
            said, code = str(refused.value), 2
        else:
            code = told([word.format(path, folder=tmp_path) for word in row.words])
            said = "".join(capfd.readouterr())
    assert row.says in said
    assert code == row.code, said
    assert "Traceback" not in said
    assert not set(said) & {chr(each) for each in (*range(10), *range(11, 32), *range(127, 160))}
    assert len(said) < 3000, "a line that nobody reads"
    assert not list(tmp_path.rglob("ran"))
    assert status_mb("VmHWM") - before_mb < MOST_MB


def told(words):
    """Run a command as `main` does and return its exit code."""
    with pytest.raises(SystemExit) as ended, failures_named():
        app(words)
    return int(ended.value.code or 0)


def test_a_column_that_a_spreadsheet_would_run_is_text_in_a_copy(tmp_path):
    for name in ("=cmd|' /C calc'!A0", "+1", "-1+1", "@SUM(A1)"):
        (tmp_path / "a.csv").write_text(csv_of(name))
        if told(["export", str(tmp_path / "a.csv"), "--to", str(tmp_path / "to.csv")]) == 0:
            assert (tmp_path / "to.csv").read_text().splitlines()[0] == f"time_s,'{name}"


def test_a_terminal_gets_no_signs_that_steer_it(capsys):
    Terminal(width=200).say(f"a{ESCAPE}b\x9b31m\u202e", red="error:")
    said = capsys.readouterr().out
    assert said.strip().isprintable()
    assert "]0;owned" in said


@pytest.mark.parametrize("make", [os.mkfifo, linked("/dev/zero"), listening, linked("/etc/passwd")])
def test_a_name_in_shared_memory_that_is_no_file_is_no_ring(make):
    path = Path("/dev/shm") / f"utank-hostile-{os.getpid()}"
    make(path)
    try:
        with within(MOST_S, path.name), pytest.raises(OSError, match=r"ring|symbolic|address"):
            RingReader(path.name)
    finally:
        path.unlink()


def test_what_others_left_in_a_folder_of_recordings_is_passed_over(tmp_path, monkeypatch):
    theirs = tmp_path / "theirs"
    sparse(theirs)  # Its size counts for nothing, and it stays.
    (tmp_path / "run-1.rrd").symlink_to(theirs)
    (tmp_path / "run-2.rrd").symlink_to("run-2.rrd")
    (tmp_path / "run-3.rrd").mkdir()
    os.mkfifo(tmp_path / "run-4.frames")
    for number in (5, 6, 7):
        (tmp_path / f"run-{number}.rrd").write_bytes(bytes(1000))
    unlink = Path.unlink

    def refused(path, missing_ok=False):
        if path.name == "run-5.rrd":
            raise PermissionError(errno.EPERM, "of another user", str(path))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    make_room(tmp_path / "run-8.rrd", 1, 2500)
    left = {path.name for path in tmp_path.iterdir()}
    assert {f"run-{number}.rrd" for number in (1, 2, 3, 5, 7)} <= left
    assert "run-6.rrd" not in left
    assert theirs.stat().st_size == 1 << 40


def test_a_record_takes_the_place_of_a_link_and_leaves_what_it_leads_to(tmp_path):
    theirs, record = tmp_path / "theirs", tmp_path / "a.commissioning.json"
    theirs.write_text("theirs")
    record.symlink_to(theirs)
    write_record(record, {"passed": True})
    assert theirs.read_text() == "theirs"
    assert not record.is_symlink()


def test_a_folder_for_results_that_is_a_link_in_a_circle_or_a_socket_is_refused(tmp_path, capsys):
    (tmp_path / "circle").symlink_to("circle")
    listening(tmp_path / "socket")
    os.mkfifo(tmp_path / "pipe")
    for name in ("circle", "socket", "pipe"):
        with pytest.raises(typer.Exit), within(MOST_S, name):
            prepare_out(tmp_path / name, ("a.png",))
        assert f"{name}: " in capsys.readouterr().err


def test_a_ring_of_another_user_is_not_mapped(monkeypatch):
    with RingWriter(RingKind.ROWS, 16, 1, 8, {"columns": ["a", "b"]}) as writer:
        monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
        with pytest.raises(OSError, match="of another user"):
            RingReader(writer.name)


def test_a_page_shows_names_and_texts_and_runs_none_of_them(tmp_path):
    from utank_hil.pictures.report_page import write_report_page

    evil = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    page = write_report_page(tmp_path / "a.html", evil, evil, [], [])
    assert "<script>alert" not in page.read_text()
    assert "<img src=x" not in page.read_text()
