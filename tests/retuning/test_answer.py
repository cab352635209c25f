import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from retuning_toys import candidate_of, law_of

from utank_hil.control.washout import WashoutLaw
from utank_hil.retuning import Candidate, Refusal
from utank_hil.retuning.answer import answer_bytes, read_answer


@pytest.mark.parametrize("washout_rad_s", [0.0, 0.02])
@pytest.mark.parametrize("outputs", [1, 2])
def test_candidate_crosses_bit_for_bit(washout_rad_s: float, outputs: int) -> None:
    sent = candidate_of(1e5, washout_rad_s, order=40, outputs=outputs)
    came = read_answer(answer_bytes(sent))
    assert isinstance(came, Candidate)
    assert came.summary == sent.summary
    assert came.washout_rad_s == washout_rad_s
    assert isinstance(came.whole_law(), WashoutLaw) == (washout_rad_s > 0)
    for name in ("input_gains", "output_gains", "reference_gains"):
        assert np.array_equal(getattr(came.law, name), getattr(sent.law, name))
    assert np.array_equal(came.model.alpha, sent.model.alpha)
    assert np.array_equal(came.model.beta, sent.model.beta)
    y = np.full(outputs, 0.01)
    assert came.law.controller().step(y) == sent.law.controller().step(y)
    assert came.law.sample_time_s == law_of(1.0).sample_time_s


@pytest.mark.parametrize("reasons", [("one",), ("one", "two: größer als 5 %")])
def test_refusal_crosses_with_its_reasons(reasons: tuple[str, ...]) -> None:
    assert read_answer(answer_bytes(Refusal(reasons))) == Refusal(reasons)


@given(st.binary(max_size=400))
def test_nonsense_is_refused(data: bytes) -> None:
    for head in (b"", b"CANDIDAT"):
        try:
            answer = read_answer(head + data)
        except ValueError:
            continue
        assert isinstance(answer, Refusal)


@given(st.data())
def test_candidate_with_any_bytes_changed_is_sound_or_refused(data: st.DataObject) -> None:
    whole = bytearray(answer_bytes(candidate_of(1e5)))
    for _ in range(3):
        at = data.draw(st.integers(8, len(whole) - 1))
        whole[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(whole)))
    for content in (whole, whole[:cut]):
        try:
            answer = read_answer(bytes(content))
        except ValueError:
            continue
        if isinstance(answer, Candidate):
            assert np.isfinite(answer.law.output_gains).all()
            assert answer.law.output_gains.shape[1:] == (1, 1)
