"""A constrained law as a message: any law crosses bit for bit, and no unsound one does."""

import dataclasses
from functools import cache

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from retuning_toys import scribble

from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import PumpLimits
from utank_hil.control.constrained.horizon import condense
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.dynamics.sampling import LinearModel
from utank_hil.retuning import RenewedLaw
from utank_hil.retuning.answer import (
    LONGEST_BYTES,
    MOST_KNOTS,
    MOST_PLANNED,
    MOST_STATES,
    answer_bytes,
    read_answer,
)

SIZES = st.tuples(
    st.integers(1, 12), st.integers(1, 4), st.integers(1, 6), st.integers(7, 20), st.integers(0, 3)
)


def law_of(
    states: int, outputs: int, knots: int, samples: int, rest: int, seed: int = 1
) -> RenewedLaw:
    """A law of random numbers."""
    rng = np.random.default_rng(seed)

    def draw(*shape: int) -> FloatArray:
        return rng.normal(size=shape) / states

    a, b, c, d = (
        draw(*s) for s in ((states, states), (states, 1), (outputs, states), (outputs, 1))
    )
    model = LinearModel(a, b, c, d, float(rng.uniform(0.02, 1.0)))
    level = int(rng.integers(-1, outputs))
    limits = PumpLimits(5e4, 1e5, 4.0, float(rng.uniform(1e5, 1e6)) if level >= 0 else np.inf)
    first = int(rng.integers(0, samples))
    horizon = condense(
        model,
        (0, *sorted(rng.choice(np.arange(1, samples), knots - 1, replace=False).tolist())),
        samples,
        rng.uniform(0, 1, outputs),
        float(rng.uniform(0.1, 1)),
        first_output=first,
        terminal=draw(rest, states) if rest else None,
    )
    law = ConstrainedLaw(
        model=model,
        observer_gain=draw(states, outputs),
        horizon=horizon,
        limits=limits,
        level_output=None if level < 0 else level,
        level_penalty=0.1,
        reservoir_area_m2=50.0,
        steady_state=draw(states, states),
        steady_command=draw(states),
        iteration_limit=int(rng.integers(1, 200)),
        leeway=0.25,
    )
    return RenewedLaw(law, 0.02, 2e4, 0.03)


@cache
def encoded() -> bytes:
    return answer_bytes(law_of(5, 3, 4, 12, 5))


def parts(value: object) -> dict[str, object]:
    """All that a law holds, by name."""
    found: dict[str, object] = {}
    for field in dataclasses.fields(value):  # type: ignore[arg-type]  # it is one
        part = getattr(value, field.name)
        if dataclasses.is_dataclass(part):
            found |= {f"{field.name}.{name}": each for name, each in parts(part).items()}
        elif isinstance(part, LinearModel):
            found |= {f"{field.name}.{name}": each for name, each in part._asdict().items()}
        else:
            found[field.name] = part
    return found


@given(SIZES, st.integers(0, 2**32))
def test_any_law_crosses_bit_for_bit(sizes: tuple[int, ...], seed: int) -> None:
    sent = law_of(*sizes, seed=seed)
    came = read_answer(answer_bytes(sent))
    assert isinstance(came, RenewedLaw)
    before, after = parts(sent), parts(came)
    assert before.keys() == after.keys()
    for name, value in before.items():
        assert np.array_equal(np.asarray(value), np.asarray(after[name])), name


def test_a_law_for_the_longest_delay_crosses() -> None:
    config = load_config("configs/controllers/self_tuning.yaml", ControllerConfig)
    built = config.law.build(dataclasses.replace(config.plant, delay_s=1.0)).linear
    assert isinstance(built, ConstrainedLaw)
    came = read_answer(answer_bytes(RenewedLaw(built, 0.02, 2e4, 0.03)))
    assert isinstance(came, RenewedLaw)
    assert len(came.law.model.A) == len(built.model.A)


@given(st.data())
def test_a_damaged_byte_is_refused_or_leaves_a_sound_law(data: st.DataObject) -> None:
    whole = bytearray(encoded())
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    try:
        came = read_answer(bytes(whole))  # the mailbox's check sum is what finds damaged numbers
    except ValueError:
        return
    assert isinstance(came, RenewedLaw)
    assert np.isfinite(came.law.horizon.unlimited_state).all()


@given(st.integers(0, len(encoded()) - 1))
def test_a_cut_law_is_refused(length: int) -> None:
    with pytest.raises(ValueError, match=r"truncated"):
        read_answer(encoded()[:length])


@given(st.data())
def test_whatever_numbers_a_broken_worker_sends_none_but_a_sound_law_is_read(
    data: st.DataObject,
) -> None:
    content = msgspec.msgpack.decode(encoded())
    for _ in range(data.draw(st.integers(1, 3))):
        scribble(content, data, [0.0, -1.0, 1e-308, 1e9, 1e200, -1.7e308, np.nan, np.inf])
    try:
        # numpy's warnings are errors in these tests
        came = read_answer(msgspec.msgpack.encode(content))
    except ValueError:
        return
    assert isinstance(came, RenewedLaw)
    assert np.isfinite(came.law.horizon.unlimited_state).all()


def test_the_largest_law_fits_its_mailbox_and_a_larger_one_is_refused() -> None:
    largest = law_of(MOST_STATES, 4, MOST_KNOTS, MOST_PLANNED, 3)
    horizon = dataclasses.replace(largest.law.horizon, terminal=np.eye(MOST_STATES))
    whole = dataclasses.replace(largest, law=dataclasses.replace(largest.law, horizon=horizon))
    assert len(answer_bytes(whole)) <= LONGEST_BYTES
    for sizes in (
        (MOST_STATES + 1, 1, 1, 9, 0),
        (3, 1, MOST_KNOTS + 1, MOST_PLANNED, 0),
        (3, 1, 1, MOST_PLANNED + 1, 0),
    ):
        with pytest.raises(ValueError, match=r"states must be 1 to|of length <=|<= 150"):
            read_answer(answer_bytes(law_of(*sizes)))
