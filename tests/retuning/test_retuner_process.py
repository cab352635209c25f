"""A retuner in a real process: what it answers, and what its end, sleep and nonsense do."""

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from retuning_toys import candidate_of

from utank_hil.base.arrays import FloatArray
from utank_hil.retuning import (
    Answer,
    Candidate,
    Desk,
    Refusal,
    RetuneFunction,
    RetunerProcess,
    Work,
)
from utank_hil.retuning import retuner as retuner_module

pytestmark = pytest.mark.slow

RECORD = np.arange(12.0).reshape(6, 2)
PATIENCE_S = 30.0


def answers_with_the_sum(record: FloatArray) -> Answer:
    return Refusal((f"{record.shape} {record.sum():g}",))


def answers_with_a_law(record: FloatArray) -> Answer:
    return candidate_of(float(record[0, 0]) + 1e5, 0.02, order=200)


def sleeps(record: FloatArray) -> Answer:
    time.sleep(3600)
    raise AssertionError


def fails_on_seven(record: FloatArray) -> Answer:
    if record[0, 0] == 7:
        raise KeyError("seven")
    return Refusal(("no",))


def dies_on_seven(record: FloatArray) -> Answer:
    if record[0, 0] == 7:
        os._exit(3)
    return Refusal(("no",))


def sleeps_on_seven(record: FloatArray) -> Answer:
    return sleeps(record) if record[0, 0] == 7 else Refusal(("no",))


def answers_with_too_much(record: FloatArray) -> Answer:
    return candidate_of(1e5, order=70_000)


def work_of(compute: RetuneFunction) -> Work:
    return Work(compute, FloatArray, 200)


@contextmanager
def running(*works: RetuneFunction, hangs_after_s: float = 600.0) -> Iterator[RetunerProcess]:
    with RetunerProcess(*map(work_of, works), hangs_after_s=hangs_after_s) as retuner:
        yield retuner
    assert not _alive(retuner.pid)
    _wait(lambda: not _group_lives(retuner.pid))


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _group_lives(pid: int) -> bool:
    try:
        os.killpg(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _wait(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def _answer(retuner: RetunerProcess, number: int) -> Answer | None:
    return _answer_at(retuner.desks[0], number)


def _answer_at(desk: Desk, number: int) -> Answer | None:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        answer = desk.answer(number, 0)
        if answer is not None:
            return answer
        time.sleep(0.02)
    return None


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A heart that has not beaten for 0.6 s, not 5 s, is no sign of life."""
    monkeypatch.setattr("utank_hil.retuning.retuner._ALIVE_NS", 600_000_000)


@pytest.fixture(scope="module")
def retuner() -> Iterator[RetunerProcess]:
    """A process that does each of these works at a desk of its own."""
    works = (answers_with_the_sum, answers_with_a_law, fails_on_seven, answers_with_too_much)
    with running(*works, answers_with_the_sum) as process:
        assert process.alive
        yield process


def test_each_record_gets_its_own_answer(retuner: RetunerProcess) -> None:
    desk = retuner.desks[0]
    for number, rows in ((1, 6), (2, 3)):
        desk.submit(number, RECORD[:rows], 0)
        assert _answer_at(desk, number) == Refusal((f"({rows}, 2) {RECORD[:rows].sum():g}",))
        assert desk.answer(number + 1, 0) is None


def test_law_comes_back(retuner: RetunerProcess) -> None:
    retuner.desks[1].submit(1, RECORD, 0)
    answer = _answer_at(retuner.desks[1], 1)
    assert isinstance(answer, Candidate)
    assert answer.law.output_gains.shape == (200, 1, 1)


def test_sleep_does_not_keep_the_controller_waiting_nor_the_end() -> None:
    with running(sleeps) as retuner:
        retuner.desks[0].submit(1, RECORD, 0)
        begin_s = time.monotonic()
        for _ in range(100):
            assert retuner.desks[0].answer(1, 0) is None
            time.sleep(0.005)
        retuner.desks[0].submit(2, RECORD, 0)
        # any wait for the process would have taken a minute
        assert time.monotonic() - begin_s < 30.0


def never_beats(*_: object) -> None:
    time.sleep(3600)


def ends_at_once(*_: object) -> None:
    pass


@pytest.mark.parametrize(("process", "waited_s"), [(never_beats, 30.0), (ends_at_once, 0.01)])
def test_the_loop_begins_without_a_retuner_that_does_not_start(
    process: Callable[..., None], waited_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s, others = 0.0, set(multiprocessing.active_children())

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds
        if process is ends_at_once:
            for child in set(multiprocessing.active_children()) - others:
                child.join()
        assert now_s < 100.0

    clock = SimpleNamespace(
        monotonic=lambda: now_s, monotonic_ns=lambda: round(now_s * 1e9) + 10**12, sleep=sleep
    )
    monkeypatch.setattr(retuner_module, "time", clock)
    monkeypatch.setattr(retuner_module, "run_watchdog", process)
    with RetunerProcess(work_of(answers_with_the_sum)) as retuner:
        assert now_s == pytest.approx(waited_s)
        assert not retuner.alive
    assert not _alive(retuner.pid)


def test_both_processes_are_out_of_reach_of_ctrl_c_and_give_way_to_the_loop(
    retuner: RetunerProcess,
) -> None:
    for pid in (retuner.pid, worker_of(retuner)):
        assert pid is not None
        assert os.getpgid(pid) == retuner.pid  # not that of the terminal
        own = os.getpriority(os.PRIO_PROCESS, 0)
        assert os.getpriority(os.PRIO_PROCESS, pid) == min(own + 10, 19)


def test_work_that_fails_is_a_refusal_with_the_reason_and_the_next_order_is_worked_off(
    retuner: RetunerProcess,
) -> None:
    desk = retuner.desks[2]
    desk.submit(1, RECORD + 7, 0)
    assert _answer_at(desk, 1) == Refusal(("the retuner failed: KeyError: 'seven'",))
    desk.submit(2, RECORD, 0)
    assert _answer_at(desk, 2) == Refusal(("no",))


def test_answer_too_long_for_the_mailbox_is_a_refusal(retuner: RetunerProcess) -> None:
    retuner.desks[3].submit(1, RECORD, 0)
    answer = _answer_at(retuner.desks[3], 1)
    assert isinstance(answer, Refusal)
    assert "order must be 1 to" in answer.reasons[0]


def test_nonsense_in_the_mailbox_is_a_refusal(retuner: RetunerProcess) -> None:
    retuner.desks[4]._answers.post(1, b"\x81\xa4type\xa9candidate")
    answer = retuner.desks[4].answer(1, 0)
    assert isinstance(answer, Refusal)
    assert "nonsense" in answer.reasons[0]


@pytest.mark.usefixtures("impatient")
def test_worker_that_hangs_shows_no_sign_of_life_and_is_replaced() -> None:
    with running(sleeps_on_seven, hangs_after_s=1.0) as retuner:
        retuner.desks[0].submit(1, RECORD + 7, 0)
        _wait(lambda: not retuner.alive)
        answer = _answer(retuner, 1)
        assert answer == Refusal(("the retuner was busy for more than 1 s, and was restarted",))
        _wait(lambda: retuner.alive)
        retuner.desks[0].submit(2, RECORD, 0)
        assert _answer(retuner, 2) == Refusal(("no",))


@pytest.mark.usefixtures("impatient")
def test_without_its_keeper_it_ends_and_shows_no_sign_of_life() -> None:
    with RetunerProcess(work_of(answers_with_the_sum)) as retuner:
        assert retuner.alive
        os.kill(retuner.pid, signal.SIGKILL)
        _wait(lambda: not retuner.alive)
        retuner.desks[0].submit(1, RECORD, 0)
        assert retuner.desks[0].answer(1, 0) is None


def worker_of(retuner: RetunerProcess) -> int | None:
    children = Path(f"/proc/{retuner.pid}/task/{retuner.pid}/children").read_text().split()
    return int(children[0]) if children else None


def answers_in_a_while(record: FloatArray) -> Answer:
    time.sleep(0.2)
    return answers_with_the_sum(record)


@pytest.mark.parametrize(
    "kills", [3, pytest.param(200, marks=[pytest.mark.evidence, pytest.mark.timeout(3600)])]
)
def test_worker_killed_at_any_instant_is_replaced_and_every_record_is_answered(kills: int) -> None:
    draw, refused = random.Random(1), 0
    with running(answers_in_a_while) as retuner:
        descriptors = len(os.listdir("/proc/self/fd"))
        for number in range(1, kills + 1):
            _wait(lambda: worker_of(retuner) is not None)
            retuner.desks[0].submit(number, RECORD, 0)
            time.sleep(draw.uniform(0, 0.5))
            worker = worker_of(retuner)
            if worker is not None:
                os.kill(worker, signal.SIGKILL)
            answer = _answer(retuner, number)
            assert isinstance(answer, Refusal)
            killed = "was killed by signal 9" in answer.reasons[0]
            assert killed or answer == answers_with_the_sum(RECORD)
            refused += killed
            assert retuner.alive
        assert len(os.listdir("/proc/self/fd")) == descriptors
    print(f"{kills} kills, {refused} of them in the middle of a record")
    assert refused or kills < 10


def test_orphaned_and_closed_it_leaves_nothing_behind_that_hangs() -> None:
    with RetunerProcess(work_of(sleeps)) as retuner:
        retuner.desks[0].submit(1, RECORD, 0)
        time.sleep(0.5)
        os.kill(retuner.pid, signal.SIGKILL)
    _wait(lambda: not _group_lives(retuner.pid))


def test_retuner_ends_when_its_controller_is_killed_even_if_it_hangs() -> None:
    read, write = os.pipe()
    child = os.fork()
    if child == 0:  # a controller that is killed has no time to end anything
        retuner = RetunerProcess(work_of(sleeps))
        retuner.desks[0].submit(1, RECORD, 0)
        os.write(write, retuner.pid.to_bytes(8, "little"))
        time.sleep(60)
        os._exit(0)
    pid = int.from_bytes(os.read(read, 8), "little")
    os.close(read)
    os.close(write)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    _wait(lambda: not _group_lives(pid))


def test_each_desk_has_its_own_answers_and_a_death_refuses_the_open_ones() -> None:
    with RetunerProcess(
        work_of(answers_with_the_sum),
        work_of(dies_on_seven),
    ) as retuner:
        first, second = retuner.desks
        first.submit(1, RECORD, 0)
        second.submit(1, np.full((3, 2), 7.0), 0)
        died = Refusal(("the retuner ended with code 3, and was restarted",))
        assert _answer_at(second, 1) == died
        assert _answer_at(first, 1) == Refusal((f"(6, 2) {RECORD.sum():g}",))
        second.submit(2, RECORD, 0)  # not the order that it did not survive
        assert _answer_at(second, 2) == Refusal(("no",))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("alive", "told"), [(True, "ended with code 3"), (False, "was busy for more than 0.2 s")]
)
def test_a_worker_whose_heart_beats_is_left_alone_however_long_it_has_run(
    alive: bool, told: str
) -> None:
    class Desk:
        @property
        def beat_ns(self) -> int:
            return time.monotonic_ns() if alive else 0

    child = os.fork()
    if child == 0:
        time.sleep(0.8)
        os._exit(3)
    assert retuner_module._watch(child, Desk(), os.getppid(), 0.2) == told  # type: ignore[arg-type]
