"""Settings of all tests."""

import gc
import os
import signal
import threading
from pathlib import Path
from types import SimpleNamespace

# what is tested can be patched and is covered
os.environ.setdefault("UTANK_HIL_COMPILED", "0")

import pytest
from hypothesis import settings

import utank_hil.console.single_thread  # noqa: F401, as the commands do, before numpy loads
from utank_hil.pictures import style
from utank_hil.runners import process_priority

# machines are shared: an example that takes long says nothing about the code
settings.register_profile("search", deadline=None, print_blob=True, max_examples=200)
# the same examples each time: what lands is not left to chance; `make search` draws new ones
settings.register_profile("same", settings.get_profile("search"), derandomize=True, max_examples=25)
settings.register_profile("few", settings.get_profile("same"), max_examples=10)  # make test-fast
settings.load_profile("same")


def pytest_configure(config):
    """Begin in another file in each worker of a run of all tests.

    One compiles, with its assertions, what the others then find compiled: in a new clone 15 of 27
    seconds each.
    """
    worker = getattr(config, "workerinput", None)
    if worker and [Path(each).resolve() for each in config.args] == [Path(__file__).parent]:
        files = sorted(map(str, Path(__file__).parent.rglob("test_*.py")))
        first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        config.args[:] = files[first:] + files[:first]


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect no garbage in what grows only: it would take a quarter of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses
def pytest_collection_modifyitems(items):
    """Order the files alike in each worker; give a marker `evidence` to the parameters it names."""
    items.sort(key=lambda item: item.path)
    for item in items:
        own = item.own_markers
        for mark in [each for each in own if each.name == "evidence" and each.args]:
            if item.callspec.id not in mark.args:  # of a Function
                own.remove(mark)


@pytest.fixture(scope="session", autouse=True)
def _signals_reach_the_processes_of_tests():
    """Ignored signals, as under `nohup`, are inherited; a handler that does nothing is not."""
    for number in (signal.SIGINT, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


@pytest.fixture(autouse=True)
def _every_picture_is_legible(monkeypatch):
    """Look at each picture that is drawn, whichever test has it drawn (`legible`)."""
    save, found = style.save_figure, []

    def looked_at(figure, path, metadata):
        save(figure, path, metadata)
        from legible import flaws

        found.extend(f"{path.name}: {flaw}" for flaw in flaws(figure))

    monkeypatch.setattr(style, "save_figure", looked_at)
    yield
    assert not found, "\n".join(found)


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium (`browsing`)."""
    from browsing import launched

    with launched() as started:
        yield started


@pytest.fixture
def one_process():
    """Run benches and campaigns in this process (`one_process.py`)."""
    from one_process import in_one_process

    with in_one_process():
        yield


@pytest.fixture
def read_here(monkeypatch):
    """Read recordings in this process: a new one takes half a second to import Rerun."""
    from utank_hil.telemetry import recording_reader

    monkeypatch.setattr(recording_reader, "apart", lambda function, *given: function(*given))


@pytest.fixture
def few_rolls(monkeypatch):
    """Predict from a tenth of the ship's time and in one more loading, not four.

    For what does not judge the figures.
    """
    from firmware_sim import prediction

    monkeypatch.setitem(prediction.predict.__kwdefaults__, "seeds", prediction.SEEDS[:1])
    monkeypatch.setattr(prediction, "ROLLS", 4)
    monkeypatch.setattr(prediction, "PERIOD_SCALES", (1.0, 1.3))


_MCL_ONFAULT = 0x4


@pytest.fixture(autouse=True, scope="module")
def _a_loop_runs_where_other_tests_ran():
    """Let the loop run in a process where other tests have left threads and address space.

    It locks the memory that is in use. All that is mapped would stay in memory for good: gigabytes.
    """
    left = set(threading.enumerate()) - {threading.current_thread()}
    # it collects garbage before it begins: of what is imported half a second each time
    gc.collect()
    gc.freeze()

    def begun_since():
        return [thread for thread in threading.enumerate() if thread not in left]

    seen = SimpleNamespace(enumerate=begun_since, current_thread=threading.current_thread)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_priority, "threading", seen)
        patch.setattr(process_priority, "_MCL_FUTURE", process_priority._MCL_FUTURE | _MCL_ONFAULT)
        yield
