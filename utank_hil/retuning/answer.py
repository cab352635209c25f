"""What comes of an identification: a candidate for the law, or a refusal with reasons.

Both cross from one process to another as plain bytes; reading them executes nothing and accepts
nothing that is not exactly one of the two.
"""

import math
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import ARX, LinearLaw, PredictiveLaw
from utank_hil.control.washout import WashoutLaw

_CANDIDATE: Final = b"CANDIDAT"
_REFUSAL: Final = b"REFUSAL "
_LONGEST: Final = 2000  # samples of past or future that a law or model may have
_REASONS_BYTES: Final = 4000


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """What was identified, and what the law promises, in figures.

    Attributes
    ----------
    roll_period_s : float
        Of the ship without tank water.
    period_deviation : float
        Standard deviation of the period, as a part of it.
    inertia_kg_m2, stiffness_nm_rad, damping_nms_rad : float
        Of the ship.
    tank_damping_ratio : float
    held_out_fit : float
        Least one-step fit of an output on data not used.
    peak_sensitivity : float
        Of the law on the identified ship.
    roll_below_passive : float
        Share by which the law makes the roll of the recorded waves less than the passive tank.
    """

    roll_period_s: float
    period_deviation: float
    inertia_kg_m2: float
    stiffness_nm_rad: float
    damping_nms_rad: float
    tank_damping_ratio: float
    held_out_fit: float
    peak_sensitivity: float
    roll_below_passive: float


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A law that passed every check, with the model it predicts with.

    Attributes
    ----------
    law : PredictiveLaw
    washout_rad_s : float
        0 for none.
    model : ARX
        What its predictions are judged by.
    summary : ModelSummary
    """

    law: PredictiveLaw
    washout_rad_s: float
    model: ARX
    summary: ModelSummary

    def whole_law(self) -> LinearLaw:
        """The law with its washout."""
        return WashoutLaw(self.law, self.washout_rad_s) if self.washout_rad_s else self.law


@dataclass(frozen=True, slots=True)
class Refusal:
    """No law: why.

    Attributes
    ----------
    reasons : tuple of str
        At least one.
    """

    reasons: tuple[str, ...]


Answer = Candidate | Refusal


def answer_bytes(answer: Answer) -> bytes:
    """An answer as bytes for another process."""
    if isinstance(answer, Refusal):
        return _REFUSAL + "\n".join(answer.reasons).encode(errors="replace")[:_REASONS_BYTES]
    law, model = answer.law, answer.model
    order, inputs, outputs = law.output_gains.shape
    numbers: list[FloatArray | list[float]] = [
        [
            order,
            inputs,
            outputs,
            len(law.reference_gains),
            model.order,
            answer.washout_rad_s,
            law.sample_time_s,
        ],
        [getattr(answer.summary, field.name) for field in fields(ModelSummary)],
        *(
            array.ravel()
            for array in (
                law.input_gains,
                law.output_gains,
                law.reference_gains,
                model.alpha,
                model.beta,
            )
        ),
    ]
    return _CANDIDATE + np.concatenate(numbers).tobytes()


def read_answer(data: bytes) -> Answer:
    """The answer in `data`.

    Raises
    ------
    ValueError
        If it holds anything else.
    """
    kind, content = data[:8], data[8:]
    if kind == _REFUSAL:
        return Refusal(tuple(content.decode(errors="replace").split("\n")))
    if kind != _CANDIDATE or len(content) % 8:
        raise ValueError("the answer is neither a candidate nor a refusal")
    values = _Values(np.frombuffer(content))
    order, inputs, outputs, horizon, model_order = (values.size() for _ in range(5))
    washout_rad_s, sample_time_s = values.take(2).tolist()
    summary = ModelSummary(*values.take(len(fields(ModelSummary))).tolist())
    law = PredictiveLaw(
        values.array(order, inputs, inputs),
        values.array(order, inputs, outputs),
        values.array(horizon, inputs, outputs),
        sample_time_s,
    )
    model = ARX(
        values.array(model_order, outputs, outputs),
        values.array(model_order + 1, outputs, inputs),
        sample_time_s,
    )
    values.end()
    if not washout_rad_s >= 0:
        raise ValueError(f"the answer's washout is {washout_rad_s} rad/s")
    return Candidate(law, washout_rad_s, model, summary)


class _Values:
    """Finite numbers, taken one after the other."""

    def __init__(self, values: FloatArray) -> None:
        if not np.isfinite(values).all():
            raise ValueError("the answer holds numbers that are not finite")
        self._values = values
        self._next = 0

    def take(self, count: int) -> FloatArray:
        """The next `count` numbers."""
        taken = self._values[self._next : self._next + count]
        if len(taken) < count:
            raise ValueError("the answer is too short")
        self._next += count
        return taken

    def size(self) -> int:
        """The next number as a dimension."""
        value = float(self.take(1)[0])
        if not (1 <= value <= _LONGEST and math.floor(value) == value):
            raise ValueError(f"the answer has a dimension of {value}")
        return int(value)

    def array(self, *shape: int) -> FloatArray:
        """The next numbers as an array of its own."""
        return self.take(math.prod(shape)).reshape(shape).copy()

    def end(self) -> None:
        """Refuse numbers left over."""
        if self._next != len(self._values):
            raise ValueError("the answer is too long")
