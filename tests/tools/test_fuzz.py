import pytest

from tools.fuzz import configurations, frames
from tools.fuzz.frames import FuzzError
from utank_hil.canbus import Frame, Mode
from utank_hil.canbus.endpoints import Receiver
from utank_hil.configuration import files
from utank_hil.nodes.inbox import Inbox


@pytest.mark.slow
def test_noise_breaks_no_claim_in_any_mode() -> None:
    counts = frames.fuzz(30_000, seed=1)
    assert counts["whole"] + counts["not whole"] == 30_000
    assert min(counts[f"in {mode.name}"] for mode in Mode) > 100
    assert counts["not whole"] > 15_000


def test_a_frame_that_is_not_whole_and_is_believed_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def believe(self: Inbox, frame: Frame, now_ns: int) -> None:
        subscription = self._subscriptions.get(frame.can_id)
        if subscription is not None and len(frame.data) == 7:
            self._tank_ns = now_ns

    monkeypatch.setattr(Inbox, "receive", believe)
    with pytest.raises(FuzzError, match=r"seed 1, session \d+: .*is not whole"):
        frames.fuzz(20_000, seed=1)


def test_a_node_that_raises_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    accept = Receiver.accept

    def fussy(self: Receiver[tuple[object, ...]], frame: Frame) -> object:
        if len(frame.data) == 64:
            raise IndexError("too long")
        return accept(self, frame)

    monkeypatch.setattr(Receiver, "accept", fussy)
    with pytest.raises(FuzzError, match="too long"):
        frames.fuzz(20_000, seed=1)


def test_the_same_seed_disturbs_in_the_same_way() -> None:
    assert frames.fuzz(2_000, seed=5) == frames.fuzz(2_000, seed=5) != frames.fuzz(2_000, seed=6)


@pytest.mark.slow
def test_mutated_configurations_are_accepted_or_refused_with_their_place() -> None:
    counts = configurations.fuzz(200, seed=1)
    assert counts["accepted"] > 10
    assert counts["refused"] > 100


def test_a_reader_that_raises_something_else_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files._Reader, "located", lambda *_: 1 / 0)
    with pytest.raises(configurations.FuzzError, match=r"seed 1, number \d+, .*ZeroDivisionError"):
        configurations.fuzz(50, seed=1)
