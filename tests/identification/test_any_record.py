"""Whatever a record holds, it ends in a finite model or in a refusal that says why."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from roll_plant import plant, pulses, realized

from utank_hil.base.arrays import FloatArray
from utank_hil.control import ARX
from utank_hil.identification import (
    IdentificationError,
    era,
    find_disturbance_frequencies,
    okid,
    validate,
)

pytestmark = pytest.mark.slow

FINITE = st.floats(allow_nan=False, allow_infinity=False)
KINDS = "stuck", "still", "saturated", "clipped", "gap", "holes"
Record = tuple[FloatArray, FloatArray]


@st.composite
def ship_records(draw):
    """A ship's record in any units, with any noise."""
    samples = draw(st.integers(1, 400))
    seed = draw(st.integers(0, 20))
    u = pulses(seed)[:samples]
    y = plant().respond(u, 0 * u)[:, : draw(st.integers(1, 2))]
    noise = np.random.default_rng(seed).standard_normal(y.shape)
    y = y + draw(st.sampled_from([0.0, 1e-12, 1e-4, 1.0])) * noise
    exponents = st.integers(-150, 150)
    return u * 10.0 ** draw(exponents), y * 10.0 ** draw(exponents)


@st.composite
def number_records(draw):
    """Any finite numbers, most of them equal."""
    samples = draw(st.integers(1, 60))
    shapes = (samples, draw(st.integers(1, 2))), (samples, draw(st.integers(1, 2)))
    u, y = (draw(arrays(np.float64, shape, elements=FINITE, fill=FINITE)) for shape in shapes)
    return u, y


@st.composite
def spoiled(draw):
    """A record as broken sensors, full actuators and bad lines leave it."""
    u, y = draw(ship_records() | number_records())
    u, y = u.copy(), y.copy()
    begin = draw(st.integers(0, len(u)))
    part = slice(begin, begin + draw(st.integers(0, len(u))))
    kinds = draw(st.sets(st.sampled_from(KINDS)))
    for kind in (kind for kind in KINDS if kind in kinds):
        if kind == "stuck":
            y[part] = y[min(begin, len(y) - 1)]
        elif kind == "still":
            u[part] = 0.0
        elif kind in ("saturated", "clipped"):
            array = u if kind == "saturated" else y
            limit = draw(st.floats(0.0, 1.0)) * np.abs(array).max()
            np.clip(array, -limit, limit, out=array)
        elif kind == "gap":
            y[part] = np.nan
        else:
            u[begin :: draw(st.integers(1, 50))] = draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    return u, y


def says_why(refusal):
    assert len(str(refusal).split()) > 5


def model_of(u, y, order):
    """The model, None for a refusal."""
    try:
        return okid(u, y, order, sample_time_s=0.2)
    except IdentificationError as refusal:
        says_why(refusal)
        return None


@given(spoiled(), st.integers(1, 30))
def test_okid_ends_in_a_finite_model_or_a_refusal(record, order):
    result = model_of(*record, order)
    if result is not None:
        assert np.isfinite(result.markov).all()
        assert np.isfinite(result.residual_covariance).all()


@given(spoiled(), st.integers(1, 12), st.integers(1, 40))
@example((np.array([0.0, 0, 0, 1, 0, 1e-295, 0])[:, None], np.eye(7)[:, 5:6]), 1, 1)
def test_validation_ends_in_figures_or_a_refusal(record, order, lags):
    u, y = record
    half = len(u) // 2
    result = model_of(u[:half], y[:half], order)
    outputs, inputs = y.reshape(len(y), -1).shape[1], u.reshape(len(u), -1).shape[1]
    arx = ARX(np.full((2, outputs, outputs), 0.3), np.ones((3, outputs, inputs)), 0.2)
    try:
        check = validate(arx if result is None else result.arx, u[half:], y[half:], (), lags)
    except IdentificationError as refusal:
        says_why(refusal)
        return
    assert check.rows > lags
    assert (check.one_step_fit <= 1).all()
    assert (np.abs(check.residual_correlation) <= 1 + 1e-9).all()


@given(spoiled(), st.integers(3, 20))
def test_what_follows_okid_takes_every_model_it_makes(record, order):
    result = model_of(*record, order)
    if result is None:
        return
    try:
        system = realized(result)
    except IdentificationError as refusal:
        says_why(refusal)
        return
    for matrix in (system.A, system.B, system.C, system.D):
        assert np.isfinite(matrix).all()


@given(
    arrays(
        np.float64,
        st.tuples(st.integers(3, 40), st.integers(1, 2), st.integers(1, 2)),
        elements=FINITE,
        fill=FINITE,
    )
)
def test_era_ends_in_a_finite_model_or_a_refusal(markov):
    try:
        system = era(markov, sample_time_s=0.2)
    except ValueError as refusal:  # an IdentificationError is one
        says_why(refusal)
        return
    for matrix in (system.A, system.B, system.C, system.D):
        assert np.isfinite(matrix).all()


@given(spoiled())
def test_waves_are_looked_for_in_any_record(record):
    try:
        lines = find_disturbance_frequencies(*record, sample_time_s=0.2)
    except IdentificationError as refusal:
        says_why(refusal)
        return
    assert all(0 < line < 3 for line in lines)
