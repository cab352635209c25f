import math
import tracemalloc
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from retuning_toys import SUMMARY, Rig, ToyRetuner, candidate_of, law_of, scribble

from utank_hil.canbus import Verdict
from utank_hil.control import PredictiveLaw
from utank_hil.control.predictive.design import MOST_ORDER, MOST_SAMPLES, WashoutLaw
from utank_hil.dynamics.linear import STATES
from utank_hil.retuning import Candidate, MotionEstimate, Refusal, ShipFigures
from utank_hil.retuning.adaptive import gains
from utank_hil.retuning.answer import LONGEST_BYTES, answer_bytes, read_answer
from utank_hil.retuning.law_bank import WarmUp
from utank_hil.sea import SlopeSpectrum


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
    y = np.full(outputs, 0.01)
    assert came.law.controller().step(y) == sent.law.controller().step(y)
    assert came.law.sample_time_s == law_of(1.0).sample_time_s


@pytest.mark.parametrize("reasons", [("one",), ("one", "two: größer als 5 %")])
def test_refusal_crosses_with_its_reasons(reasons: tuple[str, ...]) -> None:
    assert read_answer(answer_bytes(Refusal(reasons))) == Refusal(reasons)


@given(st.binary(max_size=400))
@example(b"\x91" * 100_000)  # nested deeper than Python goes
@example(b"\x82\xa4type\xa7refusal\xa6answer\x81\xa7reasons\xdd\xff\xff\xff\xff")
def test_nonsense_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        read_answer(data)


def test_numbers_of_numpy_cross_as_numbers_of_python() -> None:
    sent = MotionEstimate(
        Verdict.RECORD_SHORT,
        Verdict.MOTION_SMALL,
        rms_deviation=np.float64(1) / 3,
        hs_m=np.float64(4),
    )
    came = read_answer(answer_bytes(sent))
    assert isinstance(came, MotionEstimate)
    assert (came.rms_deviation, came.hs_m) == (1 / 3, 4.0)
    assert type(came.rms_deviation) is float


@pytest.mark.parametrize("told", [True, False])
def test_an_estimate_crosses_bit_for_bit(told: bool) -> None:
    sent = MotionEstimate(Verdict.RECORD_SHORT, Verdict.MOTION_SMALL)
    if told:
        omega = np.linspace(0.2, 2.0, 50)
        waves = SlopeSpectrum(omega, np.exp(-omega))
        ship = ShipFigures(1e9, 2e9, 5e7, 0.02, 0.01)
        sent = MotionEstimate(Verdict.GOOD, Verdict.UNCERTAIN, ship, waves, 0.05, 3.2, 9.1, 1200.0)
    came = read_answer(answer_bytes(sent))
    assert isinstance(came, MotionEstimate)
    assert answer_bytes(came) == answer_bytes(sent)
    assert (came.of_sea, came.of_ship, came.ship) == (sent.of_sea, sent.of_ship, sent.ship)


def law_of_size(order: int, horizon: int, outputs: int, gain: float = 0.0) -> Candidate:
    law = PredictiveLaw(
        np.full((order, 1, 1), gain),
        np.full((order, 1, outputs), gain),
        np.full((horizon, 1, outputs), gain),
        0.2,
    )
    return Candidate(law, 0.02, SUMMARY)


def test_the_largest_answer_that_a_configuration_can_ask_for_fits_its_mailbox() -> None:
    whole = answer_bytes(law_of_size(MOST_ORDER, MOST_SAMPLES, len(STATES)))
    assert len(whole) <= LONGEST_BYTES
    assert isinstance(read_answer(whole), Candidate)


@pytest.mark.parametrize(
    "size", [(MOST_ORDER + 1, 5, 1), (5, MOST_SAMPLES + 1, 1), (5, 5, len(STATES) + 1)]
)
def test_a_larger_law_is_refused(size: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match=r"(order|samples|outputs) must be 1 to"):
        law_of_size(*size)


@pytest.mark.parametrize("washout_rad_s", [-0.02, math.inf, math.nan])
def test_a_washout_that_is_none_is_refused(washout_rad_s: float) -> None:
    with pytest.raises(ValueError, match="washout"):
        candidate_of(1e5, washout_rad_s)


@pytest.mark.parametrize("character", ["x", "\n", "é", "\U0001f6a2"])
def test_a_long_refusal_is_cut(character: str) -> None:
    whole = answer_bytes(Refusal((character * (1 << 20),) * 50))
    assert len(whole) <= LONGEST_BYTES
    assert read_answer(whole) == Refusal((character * 500,) * 20)


@pytest.mark.parametrize("washout_rad_s", [0.0, 0.02, 1e308])
def test_admission_of_the_largest_law_allocates_no_square_of_its_order(
    washout_rad_s: float,
) -> None:
    candidate = replace(law_of_size(MOST_ORDER, MOST_SAMPLES, 1, 1e-3), washout_rad_s=washout_rad_s)
    controller = Rig(ToyRetuner()).controller
    tracemalloc.start()
    try:
        warm_up = controller._admit(candidate)
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert isinstance(warm_up, WarmUp)
    assert peak_bytes < MOST_ORDER**2


@pytest.mark.parametrize(("gain", "admitted"), [(9e8, True), (1.1e9, False), (np.inf, False)])
def test_gains_on_a_reference_are_bounded(gain: float, admitted: bool) -> None:
    good = candidate_of(1e5)
    law = good.law
    on_reference = np.zeros_like(law.reference_gains)
    on_reference.flat[0] = gain
    other = PredictiveLaw(law.input_gains, law.output_gains, on_reference, law.sample_time_s)
    answer = Rig(ToyRetuner()).controller._admit(replace(good, law=other))
    assert isinstance(answer, WarmUp) is admitted
    assert admitted or answer == "the law's gains on a reference are out of bounds"


@given(st.data())
def test_gains_are_those_of_the_whole_laws_matrices(data: st.DataObject) -> None:
    outputs = data.draw(st.integers(1, 2))
    gain = data.draw(st.floats(-1e6, 1e6))
    washout_rad_s = data.draw(st.sampled_from([0.0, 0.02, 3.0]))
    candidate = candidate_of(gain, washout_rad_s, order=7, outputs=outputs)
    whole = candidate.whole_law()
    model = whole.matrices()  # in observer form: the command is the first state
    of_matrices = np.abs(model.A[:, 0]).sum(), np.abs(model.B).sum()
    assert gains(whole) == pytest.approx(of_matrices, rel=1e-12)


EXTREME = [0.0, -1.0, 1e-308, -5e-324, 1e9, -1e200, 1.7e308, -1.7e308, math.nan, math.inf]


@given(st.data())
def test_no_answer_of_any_numbers_makes_a_warning_in_the_loop(data: st.DataObject) -> None:
    content = msgspec.msgpack.decode(answer_bytes(candidate_of(1e5, 0.02)))
    for _ in range(data.draw(st.integers(1, 3))):
        scribble(content, data, EXTREME)
    try:
        answer = read_answer(msgspec.msgpack.encode(content))
    except ValueError as error:
        answer = Refusal((str(error),))
    rig = Rig(ToyRetuner(answer))
    rig.run(200)
    rig.press(retune=True)  # numpy's warnings are errors in these tests
    rig.run(300)


@given(st.data())
def test_candidate_with_any_bytes_changed_is_sound_or_refused(data: st.DataObject) -> None:
    whole = bytearray(answer_bytes(candidate_of(1e5)))
    for _ in range(3):
        at = data.draw(st.integers(0, len(whole) - 1))
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
