"""A retuner in a real process: what it answers, and what its end, sleep and nonsense do."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from retuning_toys import candidate_of

from utank_hil.arrays import FloatArray
from utank_hil.runtime.retuning import Answer, Candidate, Refusal, RetunerProcess, Work

RECORD = np.arange(12.0).reshape(6, 2)
SHAPE = (100, 2)
PATIENCE_S = 30.0


def answers_with_the_sum(record: FloatArray) -> Answer:
    return Refusal((f"{record.shape} {record.sum():g}",))


def answers_with_a_law(record: FloatArray) -> Answer:
    return candidate_of(float(record[0, 0]) + 1e5, 0.02, order=200)


def sleeps(record: FloatArray) -> Answer:
    time.sleep(3600)
    raise AssertionError


def dies(record: FloatArray) -> Answer:
    os._exit(3)


@contextmanager
def running(work: Work) -> Iterator[RetunerProcess]:
    with RetunerProcess(work, SHAPE) as retuner:
        yield retuner
    assert not _alive(retuner.pid)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def _answer(retuner: RetunerProcess, number: int) -> Answer | None:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        answer = retuner.answer(number, 0)
        if answer is not None:
            return answer
        time.sleep(0.02)
    return None


def test_each_record_gets_its_own_answer() -> None:
    with running(answers_with_the_sum) as retuner:
        for number, rows in ((1, 6), (2, 3)):
            retuner.submit(number, RECORD[:rows], 0)
            answer = _answer(retuner, number)
            assert answer == Refusal((f"({rows}, 2) {RECORD[:rows].sum():g}",))
            assert retuner.answer(number + 1, 0) is None


def test_law_comes_back() -> None:
    with running(answers_with_a_law) as retuner:
        retuner.submit(1, RECORD, 0)
        answer = _answer(retuner, 1)
    assert isinstance(answer, Candidate)
    assert answer.law.output_gains.shape == (200, 1, 1)


@pytest.mark.parametrize("work", [sleeps, dies])
def test_neither_sleep_nor_death_keeps_the_controller_waiting(work: Work) -> None:
    with running(work) as retuner:
        retuner.submit(1, RECORD, 0)
        begin_s = time.monotonic()
        for _ in range(400):
            assert retuner.answer(1, 0) is None
            time.sleep(0.005)
        retuner.submit(2, RECORD, 0)
        # any wait for the process would have taken a minute
        assert time.monotonic() - begin_s < 30.0


def test_retuner_ends_when_its_controller_is_killed() -> None:
    read, write = os.pipe()
    child = os.fork()
    if child == 0:  # a controller that is killed has no time to end anything
        retuner = RetunerProcess(answers_with_the_sum, SHAPE)
        os.write(write, retuner.pid.to_bytes(8, "little"))
        time.sleep(60)
        os._exit(0)
    pid = int.from_bytes(os.read(read, 8), "little")
    os.close(read)
    os.close(write)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    end_s = time.monotonic() + PATIENCE_S
    while _alive(pid) and time.monotonic() < end_s:
        time.sleep(0.05)
    assert not _alive(pid)


def test_nonsense_in_the_mailbox_is_a_refusal() -> None:
    with running(answers_with_the_sum) as retuner:
        retuner._answers.post(1, b"CANDIDATxyz")
        answer = retuner.answer(1, 0)
    assert isinstance(answer, Refusal)
    assert "nonsense" in answer.reasons[0]
