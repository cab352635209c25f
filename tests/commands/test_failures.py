"""What a command says of files, folders and terminals that can't be used: the file, the reason."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from little_room import little_room
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.console.common import failures_named
from utank_hil.console.exit_codes import ExitCode

GPC = "configs/controllers/gpc.yaml"
SHIP = "configs/ships/thesis_first.yaml"
LOG = Path("tests/replay/every-mode.frames")
PYTHONS_OWN = ("Errno", "Traceback", "codec", "unpack", "could not convert", "os error")


def refused(*words: object) -> str:
    """What a command says that ends with the code of a wrong file."""
    result = CliRunner(env={"COLUMNS": "300"}).invoke(app, [str(word) for word in words])
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == ExitCode.USAGE
    assert result.stdout == ""
    for word in PYTHONS_OWN:
        assert word not in result.stderr
    return str(result.stderr).strip()


def commands_for(file: Path) -> list[tuple[object, ...]]:
    """The commands that read a recording, by its ending."""
    words: list[tuple[object, ...]] = [("export", file, "--to", file.parent / "to.csv")]
    if file.suffix in (".frames", ".log"):
        words.append(("replay", file, "--config", GPC))
    if file.suffix in (".rrd", ".csv"):
        words.append(("identify", file, GPC, "--out", file.parent / "out"))
    return words


@pytest.mark.parametrize("suffix", [".rrd", ".frames", ".log", ".asc", ".blf", ".csv", ".parquet"])
def test_a_recording_that_can_not_be_read_is_named_with_the_reason(
    tmp_path: Path, suffix: str
) -> None:
    missing, folder, binary = (tmp_path / f"{name}{suffix}" for name in ("no", "folder", "bytes"))
    folder.mkdir()
    binary.write_bytes(b"\xff\xfe\x00\x01" + bytes(range(256)))
    for words in commands_for(missing):
        said = refused(*words)
        assert said.startswith(f"error: {missing}: No such file or directory; it is not in ")
    for words in commands_for(folder):
        assert refused(*words) == f"error: {folder}: is a folder; name a file in it"
    for words in commands_for(binary):
        assert str(binary) in refused(*words)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".csv", ".parquet"])
def test_an_export_that_can_not_be_written_is_named_and_not_left_in_half(
    tmp_path: Path, suffix: str
) -> None:
    file = tmp_path / f"to{suffix}"
    with little_room():
        assert refused("export", LOG, "--to", file) == f"error: {file}: File too large"
    assert not file.exists()
    nowhere = tmp_path / "no" / file.name
    said = refused("export", LOG, "--to", nowhere)
    there = f"there is no folder {nowhere.parent}"
    assert said == f"error: {nowhere}: No such file or directory; {there}"


@pytest.mark.usefixtures("few_rolls")
def test_a_results_file_that_does_not_fit_ends_any_command_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with little_room(), pytest.raises(SystemExit) as ended, failures_named():
        app(["design", "tank", SHIP, "--out", str(tmp_path)], standalone_mode=False)
    assert ended.value.code == ExitCode.USAGE
    assert capsys.readouterr().err.split() == f"error: {tmp_path}/tank.png: File too large".split()


def test_a_run_too_long_for_the_memory_is_refused_in_words(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended, failures_named():
        np.empty((1 << 52, 32))
    assert ended.value.code == ExitCode.SYSTEM
    said = " ".join(capsys.readouterr().err.split())
    assert said.startswith("error: too little memory for this: Unable to allocate 1.00 EiB")


def test_a_library_that_the_memory_does_not_hold_is_said_in_words(tmp_path: Path) -> None:
    """Of the loader, as it says it: SciPy is mapped with too little address space."""
    code = (
        "import numpy, resource\n"
        "from utank_hil.console.common import failures_named\n"
        "held = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (held + (1 << 20), -1))\n"
        "with failures_named():\n"
        "    import scipy.linalg\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == ExitCode.SYSTEM, done.stderr
    assert done.stderr.startswith("error: too little memory for this")


def test_other_errors_are_those_of_the_program() -> None:
    with pytest.raises(ImportError, match="no such name"), failures_named():
        raise ImportError("no such name")
    with pytest.raises(OSError, match="reset"), failures_named():
        raise OSError(errno.ECONNRESET, "reset")


@pytest.mark.evidence("words1")
@pytest.mark.parametrize("words", [("check", SHIP), ("check", SHIP, "--json")])
def test_a_full_disk_behind_standard_output_is_said(words: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = started(words, stdout=full)
    assert done.returncode == ExitCode.USAGE
    assert done.stderr == "error: No space left on device\n"


@pytest.mark.parametrize("words", ["--help", "--version", f"check {SHIP}", f"check {SHIP} --json"])
def test_a_pipe_that_nobody_reads_ends_it_quietly_as_sigpipe_does(words: str) -> None:
    read, written = os.pipe()
    os.close(read)
    with os.fdopen(written, "w") as closed:
        done = started(tuple(words.split()), stdout=closed)
    assert (done.returncode, done.stderr) == (ExitCode.UNREAD, "")
    assert ExitCode.UNREAD == 128 + signal.SIGPIPE


@pytest.mark.evidence("2>&-", "<&-")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_standard_stream_is_nothing_and_its_number_is_not_another_file_s(
    tmp_path: Path, closed: str
) -> None:
    opened = tmp_path / "opened"
    program = (
        "import os, sys\n"
        "from utank_hil.console.common import failures_named\n"
        "with failures_named():\n"
        f"    print('text'); print('text', file=sys.stderr)\n"
        f"    number = os.open({str(opened)!r}, os.O_CREAT | os.O_RDWR)\n"
        "    os.write(number, str(number).encode())\n"
    )
    words = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", program]
    assert subprocess.run(words, stdout=subprocess.DEVNULL, check=False).returncode == 0
    assert int(opened.read_text()) > 2


def test_no_output_at_all_ends_with_the_same_code() -> None:
    with Path("/dev/full").open("w") as full:
        assert started(("check", SHIP), stdout=full, stderr=full).returncode == ExitCode.USAGE


@pytest.mark.evidence
def test_a_terminal_that_lacks_a_sign_gets_a_question_mark() -> None:
    done = started(("check", GPC), stdout=subprocess.PIPE, encoding="ascii")
    assert done.returncode == ExitCode.OK, done.stderr
    assert "m?/s" in done.stdout


def started(
    words: tuple[str, ...],
    stdout: object,
    encoding: str = "utf-8",
    stderr: object = subprocess.PIPE,
) -> Any:
    return subprocess.run(
        [sys.executable, "-c", "from utank_hil.cli import main; main()", *words],
        stdout=stdout,
        stderr=stderr,
        text=True,
        env=os.environ | {"PYTHONIOENCODING": encoding, "COLUMNS": "200"},
        check=False,
    )
