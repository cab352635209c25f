"""What the controller's process loads: no plotting, no viewer, no compiler."""

import importlib.metadata
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from utank_hil.console.common import EXTRA_OF
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.run_log import read_run_log

pytestmark = pytest.mark.slow

READERS = ("asammdf", "pandas", "sympy")
HEAVY = ("matplotlib", "numba", "rerun", "control", "pyarrow", "firmware_sim", *READERS)

COMMAND = "import utank_hil.cli, utank_hil.commands.run, utank_hil.commands.panel"

LOOP = """
from pathlib import Path
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.console.common import load
from utank_hil.commands.recording import RunRecording
from utank_hil.commands.run import run
from utank_hil.configuration import ControllerConfig
from utank_hil.runners import RealTimeLoop, real_time_scheduling, stop_on_signals
from utank_hil.assembly import build_controller_node
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import SimulatedRetuner
from utank_hil.telemetry.ring import RowWriter

assert SocketCanPort
files = sorted(Path("configs/controllers").glob("*.yaml"))
configs = [load(path, ControllerConfig) for path in files]
# one of each kind
for config in {(type(each.law), each.retuning is None): each for each in configs}.values():
    with RowWriter(SIGNALS, slots=64) as ring:
        retuner = None if config.retuning is None else SimulatedRetuner(print, 1.0)
        node = build_controller_node(config, sink=ring.write, retuner=retuner)
        with stop_on_signals() as stop, real_time_scheduling():
            RealTimeLoop([node]).run(stop, 300_000_000)
        assert ring.count >= 10
"""

CATALOGUE = "from utank_hil.canbus import load_catalogue; load_catalogue()"

CHECK = """
import sys
loaded = sorted({{name.partition(".")[0] for name in sys.modules}} & set({heavy!r}))
print(*loaded)
"""


def loaded_by(source, heavy=HEAVY):
    """Heavy packages that a new interpreter holds after running `source`."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", source + CHECK.format(heavy=heavy)],
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(
    "source",
    [COMMAND, f"import utank_hil.commands.run\n{CATALOGUE}", LOOP],
    ids=["command line", "run that reads the catalogue first", "loop"],
)
def test_controllers_process_loads_nothing_heavy(source):
    assert loaded_by(source) == ""


@pytest.mark.parametrize(
    "source", [COMMAND, CATALOGUE, "import utank_hil.telemetry.viewer, utank_hil.pictures"]
)
def test_scipy_is_loaded_with_the_first_design(source):
    """It takes a third of a command's start."""
    assert loaded_by(source, (*HEAVY, "scipy")) == ""


def test_the_package_of_the_bus_reads_no_catalogue_before_it_is_asked_for():
    assert loaded_by("import utank_hil.canbus", ("cantools", "can")) == ""


def test_margins_are_judged_without_anything_heavy_because_run_does_it_first():
    source = """
from pathlib import Path
from utank_hil.console.admission import admit
from utank_hil.configuration import ControllerConfig, load_config
path = Path("configs/controllers/gpc.yaml")
assert admit(load_config(path, ControllerConfig), path).linear is not None
"""
    assert loaded_by(source) == ""


def test_an_emulated_ship_loads_no_reader_of_measurements():
    source = f"import firmware_sim.cli, firmware_sim.run\n{CATALOGUE}"
    assert not set(READERS) & set(loaded_by(source).split())


def test_the_test_can_fail():
    assert loaded_by("import matplotlib") == "matplotlib"


WITHOUT_EXTRAS = """
import sys

class Without:
    def __init__(self, finder):
        self.finder = finder

    def __getattr__(self, name):
        return getattr(self.finder, name)

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing!r}:
            return None
        return self.finder.find_spec(name, path, target)

sys.meta_path[:] = [Without(finder) for finder in sys.meta_path]
sys.path.insert(0, "tests/commands")
import ports
import utank_hil.canbus.socketcan
utank_hil.canbus.socketcan.SocketCanPort = ports.QuietBus
from {module}.cli import main
sys.argv = {words!r}
try:
    main()
finally:
    print(*sorted({{name.partition(".")[0] for name in sys.modules}}), file=sys.stderr)
"""


def without_extras(module, *words):
    """A command where only the dependencies of `run` are installed; prints what it has loaded."""
    source = WITHOUT_EXTRAS.format(missing=set(EXTRA_OF), module=module, words=["x", *words])
    return subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, timeout=120, check=False
    )


def dependencies(names):
    """The distributions that some need, with what those need, without any extras."""
    found: set[str] = set()
    waiting = list(names)
    while waiting:
        name = re.match(r"[\w.-]+", waiting.pop())[0].lower().replace("_", "-")
        if name not in found:
            found.add(name)
            try:
                needs = importlib.metadata.requires(name) or []
            except importlib.metadata.PackageNotFoundError:
                continue  # for another platform
            waiting += [each for each in needs if "extra ==" not in each]
    return found


PROJECT = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.mark.evidence("check configs/scenarios/voyage.yaml", "check configs/ships/patti_b.yaml")
@pytest.mark.parametrize(
    "words",
    [
        ("check", "configs/scenarios/voyage.yaml"),
        ("check", "configs/ships/patti_b.yaml"),
        ("run", "configs/controllers/constrained_gpc.yaml", "--bus", "any0", "--duration", "0.3"),
    ],
    ids=" ".join,
)
def test_the_controllers_commands_need_nothing_but_the_dependencies_without_extras(words):
    done = without_extras("utank_hil", *words)
    assert done.returncode == 0, done.stderr
    loaded = done.stderr.splitlines()[-1].split()
    assert "numpy" in loaded
    needed = dependencies(PROJECT["dependencies"])
    owners = importlib.metadata.packages_distributions()
    foreign = {
        name: owners[name]
        for name in loaded
        if name in owners and not {each.lower().replace("_", "-") for each in owners[name]} & needed
    }
    # "utank-hil" itself; what the interpreter's own start loads in a development environment, and
    # what numpy loads where it finds it
    assert set(foreign) <= {"utank_hil", "firmware_sim", "_distutils_hack", "charset_normalizer"}


@pytest.mark.evidence
def test_a_run_writes_its_log_without_an_extra(tmp_path):
    words = ("run", "configs/controllers/gpc.yaml", "--bus", "any0", "--duration", "0.3")
    done = without_extras("utank_hil", *words, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    (log,) = tmp_path.glob("run-*.frames")
    assert FrameLog(log).head["about"]["command"] == "run"
    assert len(read_run_log(log).rows)


@pytest.mark.evidence("utank_hil-words1-rerun")
@pytest.mark.parametrize(
    ("module", "words", "package"),
    [
        ("utank_hil", ("bench", "--duration", "5"), "numba"),
        ("utank_hil", ("identify", "x.rrd", "configs/controllers/dpc.yaml"), "rerun"),
        ("firmware_sim", ("configs/scenarios/storm.yaml", "--bus", "any0"), "numba"),
    ],
)
def test_a_command_whose_extra_is_missing_names_it_and_shows_no_traceback(
    module, words, package, tmp_path
):
    (tmp_path / "x.rrd").touch()
    done = without_extras(module, *(str(tmp_path / w) if w == "x.rrd" else w for w in words))
    assert done.returncode == ExitCode.USAGE
    told = next(line for line in done.stderr.splitlines() if line.startswith("error:"))
    extra = EXTRA_OF[package]
    assert told.startswith(f"error: this needs {package}, which is not installed: ")
    assert told.endswith(f"pip install 'utank-hil[{extra}]'")
    assert "Traceback" not in done.stderr


def test_every_extra_is_one_of_the_project_and_holds_its_packages():
    extras = PROJECT["optional-dependencies"]
    held = {extra: " ".join(packages) for extra, packages in extras.items()}
    for package, extra in EXTRA_OF.items():
        assert {"rerun": "rerun-sdk", "rerun_cli": "rerun-sdk"}.get(package, package) in held[extra]
