import multiprocessing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.retuning.retuner import Mailbox


@given(st.lists(st.binary(max_size=64), min_size=1, max_size=5))
def test_what_is_posted_is_read_and_each_message_replaces_the_one_before(
    messages: list[bytes],
) -> None:
    box = Mailbox(64)
    for number, message in enumerate(messages, start=1):
        assert box.read(number) is None
        box.post(number, message)
        assert box.number == number
        assert box.read(number) == message
        assert box.read(number - 1) is None


def test_empty_mailbox_holds_nothing() -> None:
    box = Mailbox(8)
    assert box.number == 0
    assert box.read(1) is None


@given(st.integers(0, 31 + 32), st.integers(1, 255))
def test_scribbled_message_is_no_message(at: int, scribble: int) -> None:
    box = Mailbox(32)
    message = bytes(range(32))
    box.post(7, message)
    memory = memoryview(box.__getstate__()).cast("B")  # type: ignore[arg-type]
    memory[at] ^= scribble
    assert box.read(7) in (None, message)
    # the upper half of the CRC's word is not part of it, and the heartbeat is none of the message
    if at < 20 or at >= 32:
        assert box.read(7) is None


def test_message_that_is_too_long_is_refused_and_the_one_before_stays() -> None:
    box = Mailbox(8)
    box.post(1, b"12345678")
    with pytest.raises(ValueError, match="too long"):
        box.post(2, b"123456789")
    assert box.read(1) == b"12345678"


@given(st.lists(st.integers(-(1 << 63), (1 << 63) - 1), min_size=1, max_size=5))
def test_heartbeat_is_the_latest_and_leaves_the_message_alone(beats: list[int]) -> None:
    box = Mailbox(8)
    assert box.beat_ns == 0
    box.post(1, b"message")
    for beat_ns in beats:
        box.beat(beat_ns)
        assert box.beat_ns == beat_ns
        assert box.read(1) == b"message"


@pytest.mark.parametrize("capacity", [0, -1])
def test_mailbox_without_room_is_refused(capacity: int) -> None:
    with pytest.raises(ValueError, match="capacity"):
        Mailbox(capacity)


def _echo(there: Mailbox, back: Mailbox) -> None:
    while there.number == 0:
        pass
    back.post(5, there.read(there.number) or b"nothing")


@pytest.mark.slow
def test_message_crosses_to_another_process_and_back() -> None:
    there, back = Mailbox(100), Mailbox(100)
    process = multiprocessing.get_context("spawn").Process(target=_echo, args=(there, back))
    process.start()
    there.post(3, b"hello")
    process.join(60)
    assert process.exitcode == 0
    assert back.read(5) == b"hello"
