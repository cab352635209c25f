"""Samples that come again."""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.safety.monitors.repetition import Repetition

Sample = tuple[float, float]


def taken(samples: list[Sample], within: int = 100) -> list[bool]:
    """What is found after each sample."""
    repetition, found = Repetition(within), []
    assert repetition.found is False
    for sample in samples:
        repetition.take(*sample)
        found.append(repetition.found)
    return found


def noise(count: int, steps: int = 1000) -> list[Sample]:
    """Samples of a sensor whose noise is of so many steps."""
    draw = random.Random(1)
    return [(draw.randrange(steps) * 1e-4, draw.randrange(steps) * 1e-4) for _ in range(count)]


@pytest.mark.parametrize("length", [2, 16, 99, 100])
def test_a_loop_is_found_when_so_many_of_its_samples_came_again(length: int) -> None:
    first = noise(250)
    found = taken(first + first[-length:] * 100)
    # the first of them tells how long ago
    assert found.index(True) == 250 + 32
    assert all(found[250 + 32 :])


def test_what_is_older_than_is_remembered_is_not_found() -> None:
    first = noise(101)
    assert not any(taken(first * 10))


def test_the_end_of_a_loop_ends_it() -> None:
    first, other = noise(60), noise(200)[100:]
    found = taken(first * 3 + other)
    assert found[-101:] == [True] + [False] * 100


def test_a_loop_among_whose_samples_some_are_equal_is_found() -> None:
    """The last time of the first one is not always the time of the stretch."""
    first = noise(64, steps=20)
    assert len(set(first)) < 60
    assert all(taken(first * 20)[-64:])


def test_a_signal_that_stands_still_does_not_repeat() -> None:
    assert not any(taken([(0.1, 0.0)] * 1000))
    # nor one that steps to and fro, without noise
    assert not any(taken([(0.1 + 1e-4 * (k // 10 % 2), 0.0) for k in range(1000)]))


def frozen_after(before: list[Sample], within: int = 150, same: int = 400) -> list[bool]:
    """After each of some samples that are the same, and one that differs."""
    repetition, frozen = Repetition(within), []
    for sample in before:
        repetition.take(*sample)
        assert repetition.frozen is False
    for _ in range(same):
        repetition.take(0.5, 0.0)
        frozen.append(repetition.frozen)
    repetition.take(0.5, 1e-4)
    assert repetition.frozen is False
    return frozen


@pytest.mark.parametrize("count", [44, 45, 200, 250])
def test_a_hundred_times_the_same_after_noise_is_frozen(count: int) -> None:
    # the first two tell how long ago
    assert frozen_after(noise(count)) == [False] * 101 + [True] * 299


def test_a_sensor_that_had_no_noise_before_is_not_frozen() -> None:
    """It sends the same where nothing moves: the gauges have noise then, too."""
    assert not any(frozen_after([]))
    assert not any(frozen_after(noise(43)))
    assert not any(frozen_after([(0.1, 0.0)] * 300))
    # with a coarse resolution, while she rolled
    assert not any(frozen_after([(round(0.05 * k) * 1e-3, 0.0) for k in range(300)]))
    some = [sample for sample in noise(300) for _ in range(2)]
    assert not any(frozen_after(some))


def test_nine_in_ten_samples_before_it_have_to_differ() -> None:
    for equal, expected in ((4, True), (5, False)):
        before = noise(200)
        for k in range(equal):
            before[-10 * k - 2] = before[-10 * k - 3]
        assert any(frozen_after(before)) is expected
    # of fifty pairs 45 are not enough
    assert not any(frozen_after(noise(45), within=152))
    assert any(frozen_after(noise(46), within=152))


def test_a_memory_that_is_too_short_says_nothing() -> None:
    assert not any(frozen_after(noise(300), within=102))
    assert any(frozen_after(noise(300), within=103))


def test_samples_that_are_each_sent_more_than_once_are_not_frozen() -> None:
    repetition = Repetition(150)
    for sample in noise(60):
        for _ in range(50):
            repetition.take(*sample)
            assert not repetition.frozen
    repetition = Repetition(150)
    for sample in [(0.1, 0.0), (0.2, 0.0), (0.2, 0.0), (0.3, 0.0)] * 200:
        repetition.take(*sample)
        assert not repetition.frozen


def test_a_loop_with_two_equal_samples_repeats_and_is_not_frozen() -> None:
    loop, repetition = noise(20), Repetition(150)
    loop[8] = loop[7]
    for sample in loop * 150:
        repetition.take(*sample)
        assert not repetition.frozen
    assert repetition.found


def test_one_of_both_that_differs_is_enough() -> None:
    rolls, rates = [a for a, _ in noise(50)] * 10, [b for _, b in noise(500)]
    assert not any(taken(list(zip(rolls, rates, strict=True))))
    assert not any(taken(list(zip(rates, rolls, strict=True))))


@given(st.integers(2, 40), st.integers(1, 40), st.integers(2, 5))
def test_it_remembers_no_more_than_it_may(length: int, within: int, steps: int) -> None:
    repetition = Repetition(within)
    for sample in itertools.islice(itertools.cycle(noise(length, steps)), 200):
        repetition.take(*sample)
        assert len(repetition._place_of) <= within
