"""What the commands share: their options, reading of files, errors."""

import atexit
import errno
import fcntl
import io
import json
import math
import os
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, TypeVar

import typer
from pydantic import BaseModel
from typer.core import TyperGroup

from utank_hil.base.between import ALWAYS, Between
from utank_hil.base.finite import finite
from utank_hil.base.parameters import ParameterError
from utank_hil.base.provenance import headline
from utank_hil.base.shipped import DOCS
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import notes, shown

if TYPE_CHECKING:  # it loads every law: `--help` has no use for them
    from utank_hil.configuration.files import ConfigError, ConfigProblem

ModelT = TypeVar("ModelT", bound=BaseModel)
OUT: Final = Path("out")
_CLAIMS: Final[dict[tuple[int, int], int]] = {}
"""Open descriptors of the folders that this process has claimed, by device and inode."""


def option(words: str, *flags: str, default: str | bool = True, **how: Any) -> Any:
    """An option by its help; `default` says in words what holds without it."""
    return typer.Option(*flags, help=words, show_default=default, **how)


def argument(words: str, *, default: str | bool = True, **how: Any) -> Any:
    """An argument, likewise."""
    return typer.Argument(help=words, show_default=default, **how)


def _print_version(wanted: bool) -> None:
    if wanted:
        from utank_hil.base.provenance import kernels, machine

        sys.stdout.write(f"{headline()}\n{kernels(machine())}\n")
        raise typer.Exit


Json = Annotated[
    bool, option("Print one JSON object on standard output and nothing else.", "--json")
]
Version = Annotated[
    bool, option("Print the version and end.", "--version", is_eager=True, callback=_print_version)
]
Config = Annotated[Path, argument("Controller configuration.")]


def _named(bus: str) -> str:
    if not bus.strip():
        raise typer.BadParameter("is empty; name a CAN interface, for example can0")
    return bus


Bus = Annotated[str, option("CAN interface, for example can0.", "--bus", callback=_named)]
Run = Annotated[str | None, option("Run of a recording; without it the last one.")]
From = Annotated[float | None, option("By the record's times.", "--from", metavar="SECONDS")]
To = Annotated[float | None, option("By the record's times.", "--to", metavar="SECONDS")]
Channel = Annotated[
    str | None, option("Bus to read of a log with several, as it says.", metavar="NAME")
]
AllowCode = Annotated[
    bool, option("Run code that the file names as a law or ship.", "--allow-code")
]
View = Annotated[bool, option("Show it in the viewer, as `utank-hil monitor` does.", "--view")]
Duration = Annotated[
    float | None,
    # a float without a limit may be infinite
    typer.Option("--duration", min=0.1, max=1e9, metavar="SECONDS", help="Length of a run."),
]
Seed = Annotated[int | None, option("Of waves and noise, instead of the scenario's.", min=0)]
Out = Annotated[Path, option("Folder for the results.")]


def print_json(content: Mapping[str, Any]) -> None:
    """Print the one JSON object that ``--json`` promises."""
    sys.stdout.write(json.dumps(finite(content), allow_nan=False) + "\n")


def new_app(
    help_text: str | None = None, cls: type[TyperGroup] = TyperGroup, *, completion: bool = False
) -> typer.Typer:
    """A command line in the project's style; `completion` adds what installs that of the shell."""
    return typer.Typer(
        cls=cls,
        no_args_is_help=True,
        add_completion=completion,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": ["-h", "--help"]},
        help=help_text,
        epilog=f"Pages that messages point to (docs/): {DOCS}",
    )


def why(error: object) -> str:
    """What an error says: of one of the system its file and its reason, without Python's words."""
    if not (isinstance(error, OSError) and error.strerror):
        return str(error)
    if error.filename is None:
        return error.strerror
    remedy = ""
    if isinstance(error, FileNotFoundError) and isinstance(error.filename, str | Path):
        from utank_hil.base.text_files import where_instead

        remedy = f"; {where_instead(Path(error.filename))}"
    return f"{error.filename}: {error.strerror}{remedy}"


def fail(message: object, code: ExitCode = ExitCode.USAGE) -> NoReturn:
    """Print an error and end."""
    notes.say(why(message), red="error:")
    raise typer.Exit(code)


@contextmanager
def failing(
    *kinds: type[Exception], at: object = "", code: ExitCode = ExitCode.USAGE
) -> Iterator[None]:
    """End the command at an error of these kinds; `at` is the place that it does not name."""
    try:
        yield
    except kinds as error:
        fail(f"{at}: {why(error)}" if at else error, code)


def require_writable(file: Path, option: str) -> None:
    """Make the folder of a file, or end before anything is computed in vain."""
    if reason := why_not_writable(file.parent, (file.name,)):
        fail(f"{reason}; choose another place with {option}")


def chosen_part(from_s: float | None, to_s: float | None, to: str = "--to") -> Between:
    """The part that `--from` and `to` name; end where it is empty or a time is no number."""
    for name, value in (("--from", from_s), (to, to_s)):
        if value is not None and not math.isfinite(value):
            fail(f"{name} must be a number of seconds, got {value}")
    low_s, high_s = ALWAYS[0] if from_s is None else from_s, ALWAYS[1] if to_s is None else to_s
    if not low_s < high_s:
        fail(f"--from {low_s:g} is not before {to} {high_s:g}")
    return low_s, high_s


def chosen_run(file: Path, runs: Mapping[str, Any], run: str | None) -> str:
    """Return the name of the run that is asked for, or of the last one; end if there is none."""
    name = list(runs)[-1] if run is None else run
    if name not in runs:
        fail(f"{file} has no run {name!r}; it has {', '.join(runs)}")
    return name


def load(path: Path, model: type[ModelT], *, allow_code: bool = False) -> ModelT:
    """Read a configuration, noting what is unusual; list all that is wrong and end with code 2."""
    from utank_hil.configuration.files import ConfigError, load_config

    try:
        loaded = load_config(path, model, allow_code=allow_code)
    except ConfigError as error:
        fail_with(error)
    for warning in warnings_of(loaded, path):
        notes.say(str(warning), yellow="warning:")
    return loaded


def warnings_of(loaded: BaseModel, path: Path) -> "list[ConfigProblem]":
    """What is unusual in a configuration, at the places where the values are written."""
    from utank_hil.configuration.files import Section, located

    found = loaded.warnings() if isinstance(loaded, Section) else []
    return located(ParameterError("", found), path).problems


def fail_with(error: "ConfigError") -> NoReturn:
    """List everything that is wrong with a configuration and end with exit code 2."""
    for problem in error.problems:
        notes.say(str(problem), red="error:")
    raise typer.Exit(ExitCode.USAGE) from None


def why_not_writable(folder: Path, files: Iterable[str] = ()) -> str | None:
    """Make a folder; the reason if files of these names can't be written there.

    What is made and left empty is taken away when the process ends.
    """
    if folder.exists() and not folder.is_dir():
        return f"{folder}: is not a folder"
    for each in (*reversed(folder.absolute().parents), folder.absolute()):
        if not each.exists():
            atexit.register(_taken_away_if_empty, each)  # the last one goes first
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return f"{folder}: {error.strerror}"
    for path in (folder / name for name in files):
        if path.is_dir():
            return f"{path}: is a folder"
        if path.exists() and not os.access(path, os.W_OK):
            return f"{path}: must not be written"
    return None


def _taken_away_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def prepare_out(folder: Path, files: Collection[str], *, keep: bool = True) -> Path:
    """Make the folder for results, or end with exit code 2 before anything is computed in vain.

    Former results are kept: where one of `files` is there, or another command still writes, the
    folder is the first of ``NAME-2``, ``NAME-3``, ... without. With `keep` false it is `folder`.
    """
    first = folder if folder.name else folder.resolve()
    if str(folder).encode(errors="replace") != os.fsencode(folder):
        fail(f"{folder}: is no UTF-8 here, as results need; choose another folder with --out")
    for number in count(2):
        if reason := why_not_writable(folder, files):
            fail(f"{reason}; choose another folder with --out")
        former = keep and any((folder / file).exists() for file in files)
        if not former and _claimed(folder):
            break
        if not keep:
            fail(f"{folder}: another command writes there; choose another folder with --out")
        folder = first.with_name(f"{first.name}-{number}")
    if number > 2:
        notes.say(f"former results are kept: these are in {shown(folder)}")
    return folder


_NO_LOCKS: Final = (errno.ENOLCK, errno.EOPNOTSUPP, errno.EINVAL)
"""Of a file system without locks, such as some network shares: nothing can be claimed there."""


def _claimed(folder: Path) -> bool:
    """Claim a folder for the rest of the process; False if another process has."""
    descriptor = os.open(folder, os.O_RDONLY)
    status = os.fstat(descriptor)
    if (place := (status.st_dev, status.st_ino)) in _CLAIMS:
        os.close(descriptor)
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return False
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
    _CLAIMS[place] = descriptor
    return True


EXTRA_OF: Final = {
    "asammdf": "files",
    "capytaine": "hulls",
    "cryptography": "keys",
    "distributed": "cluster",
    "fmpy": "models",
    "meshio": "hulls",
    **dict.fromkeys(("clarabel", "control", "jinja2", "matplotlib", "numba"), "bench"),
    **dict.fromkeys(("pyarrow", "rerun", "rerun_cli"), "viewer"),
}  #: Packages that are not needed to run the controller, and the extra that installs each.
KILLED: Final = "a process of this command was killed: too little memory?"


@contextmanager
def failures_named() -> Iterator[None]:
    """End in words where a package of an extra is not installed or a file can't be used.

    Signs that the terminal's encoding lacks become question marks. A standard stream that is closed
    is /dev/null: a file or the bus would get its number, and the text that is meant for it.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            stream = open(os.open(os.devnull, os.O_RDWR), mode, encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, stream)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        yield
        return
    except SystemExit as end:  # of Rich and Typer, with the code of a refusal
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        raise SystemExit(ExitCode.UNREAD) from None
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in EXTRA_OF:
            raise
        install = f"pip install 'utank-hil[{EXTRA_OF[name]}]'"
        reason, code = f"this needs {name}, which is not installed: {install}", ExitCode.USAGE
    except BrokenExecutor:
        reason, code = KILLED, ExitCode.SYSTEM
    except MemoryError as error:
        reason, code = f"too little memory for this: {error}".rstrip(": "), ExitCode.SYSTEM
    except ImportError as error:
        if "failed to map segment" not in f"{error} {error.__cause__}":  # the loader's words
            raise
        reason, code = "too little memory for this: a library can't be loaded", ExitCode.SYSTEM
    except OSError as error:
        if error.filename is None and error.errno != errno.ENOSPC:
            raise
        reason, code = why(error), ExitCode.USAGE
    notes.say(reason, red="error:")
    raise SystemExit(code)
