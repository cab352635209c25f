import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from recorded_ship import DELAY_S, LAG_S, TANK, record_of, ship_of, task_of

from utank_hil.analysis.closed_loop import closed_loop_radius
from utank_hil.analysis.margins import margins
from utank_hil.analysis.retune import identify, retune
from utank_hil.arrays import FloatArray
from utank_hil.control import pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.runtime.retuning import Candidate, Refusal
from utank_hil.runtime.retuning.answer import answer_bytes, read_answer


@pytest.mark.parametrize(("outputs", "order"), [(2, 120), (1, 200)])
@pytest.mark.parametrize("period_s", [7.5, 10.0])
def test_law_for_the_ship_of_the_record_is_found_under_a_regular_wave(
    outputs: int, order: int, period_s: float
) -> None:
    task = task_of(outputs, order)
    answer = retune(record_of(outputs, period_s), task)
    assert isinstance(answer, Candidate), answer
    assert answer.summary.roll_period_s == pytest.approx(period_s, rel=5e-3)
    assert answer.summary.roll_below_passive > 0.1
    plant = pump_model(ship_of(period_s), TANK, task.design.predictor.measured)
    assert margins(answer.whole_law(), plant, DELAY_S, LAG_S).peak_sensitivity < 2.0
    assert isinstance(read_answer(answer_bytes(answer)), Candidate)


def test_wave_and_modes_are_found_on_the_way() -> None:
    found = identify(record_of(2), task_of(2, 120))
    assert found.wave_frequencies_rad_s == (pytest.approx(0.6, abs=5e-4),)
    assert found.validation.one_step_fit.min() > 0.95


def test_same_record_same_answer_bit_for_bit() -> None:
    answers = [answer_bytes(retune(record_of(1), task_of(1, 60))) for _ in range(2)]
    assert answers[0] == answers[1]


def test_ship_outside_the_stability_booklet_is_refused() -> None:
    answer = retune(record_of(2, 5.0), task_of(2, 60))
    assert isinstance(answer, Refusal)
    assert "stability booklet" in "; ".join(answer.reasons)


def test_pulses_of_the_wrong_sign_are_refused() -> None:
    record = record_of(2)
    record[:, 0] *= -1
    assert isinstance(retune(record, task_of(2, 60)), Refusal)


def test_law_that_would_do_worse_than_the_configured_one_is_refused() -> None:
    # the ship is as configured, and the law made for a poor fit of her cannot be better
    answer = retune(record_of(1, 4 * np.pi, wave_nm=2e7), task_of(1, 60))
    if isinstance(answer, Refusal):
        assert "the configured one" in "; ".join(answer.reasons)
    else:
        assert answer.summary.roll_period_s == pytest.approx(4 * np.pi, rel=0.01)


@pytest.mark.parametrize(
    "record",
    [
        np.zeros((2500, 3)),
        np.ones((2500, 3)),
        np.full((2500, 3), np.nan),
        np.zeros((0, 3)),
        np.zeros((5, 3)),
        np.random.default_rng(1).standard_normal((2500, 3)),
        1e300 * np.random.default_rng(1).standard_normal((2500, 3)),
    ],
)
def test_record_without_a_ship_in_it_is_refused(record: FloatArray) -> None:
    answer = retune(record, task_of(2, 40))
    assert isinstance(answer, Refusal)
    assert all(answer.reasons)


def test_record_of_other_signals_is_an_error_of_the_caller() -> None:
    with pytest.raises(ValueError, match="columns"):
        retune(record_of(1), task_of(2, 40))


def _spoiled(record: FloatArray, kind: str, at: float, much: float) -> FloatArray:
    """A record as a broken sensor, a full actuator or a bad line leave it."""
    record = record.copy()
    begin = round(at * len(record))
    part = slice(begin, begin + round(much * len(record)) + 1)
    rng = np.random.default_rng(round(1e6 * (at + much)))
    if kind == "constant":
        record[part, 1:] = record[begin - 1, 1:]
    elif kind == "saturated":
        record[:, 0] = np.clip(record[:, 0], -20e3 * much, 20e3 * much)
    elif kind == "clipped":
        limit = (1 - much) * np.abs(record[:, 1:]).max(axis=0)
        record[:, 1:] = np.clip(record[:, 1:], -limit, limit)
    elif kind == "gap":
        record[part] = np.nan
    elif kind == "holes":
        record[rng.random(len(record)) < 0.1 * much, 1:] = np.nan
    elif kind == "late":
        record[:, 1:] = np.roll(record[:, 1:], round(20 * much), axis=0)
    elif kind == "scaled":
        record[part, 1:] *= 10 ** (4 * at - 2)
    elif kind == "noisy":
        record[:, 1:] += much * rng.standard_normal((len(record), 2)) * record[:, 1:].std(axis=0)
    elif kind == "infinite":
        record[part.start, 1] = np.inf
    return record


KINDS = (
    "constant", "saturated", "clipped", "gap", "holes", "late", "scaled", "noisy", "infinite",
)  # fmt: skip


@pytest.mark.slow
# a failing record takes minutes to shrink and says no more when it is small
@settings(max_examples=60, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    kind=st.sampled_from(KINDS),
    at=st.floats(0.0, 1.0),
    much=st.floats(0.0, 1.0),
    period_s=st.sampled_from([7.5, 10.0, 14.0]),
)
@example("late", 0.0, 1.0, 7.5)
@example("scaled", 1.0, 1.0, 10.0)
@example("infinite", 0.0, 0.0, 7.5)
@example("holes", 0.7694335699241333, 0.7694335699241333, 10.0)
@example("saturated", 0.0, 7.6e-308, 7.5)
def test_any_record_ends_in_a_law_that_is_stable_on_the_real_ship_or_in_a_refusal(
    kind: str, at: float, much: float, period_s: float
) -> None:
    record = _spoiled(record_of(2, period_s, duration_s=240.0), kind, at, much)
    answer = retune(record, task_of(2, 30))
    if isinstance(answer, Refusal):
        assert answer.reasons
        assert all(answer.reasons)
        return
    law = answer.whole_law()
    measured = ("roll_rad", "level_m")
    plant = sample(pump_model(ship_of(period_s), TANK, measured), 0.2, DELAY_S, LAG_S)
    assert closed_loop_radius(law, plant) < 1
