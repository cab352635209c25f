"""The retuner's answers: a law, an estimate of waves and ship, or a refusal with reasons.

Requests and answers pass between processes as MessagePack of typed values. Decoding executes no
code. It rejects, with its place, what is not of the declared type and shape, and anything too large
for the loop to read, build and step between two ticks. Arrays cross as shape and float64 numbers,
bit for bit.

The message of a renewed law holds model, predictor, knots and the plan that `condense` found. The
predictions over the horizon follow by `predictions`, on every processor bit for bit, in less time
than their transfer takes.
"""

import math
from dataclasses import astuple, dataclass, fields
from typing import Annotated, Any, Final

import msgspec
import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.events import ModelSummary
from utank_hil.control import LinearLaw, PredictiveLaw, PumpLimits, WashoutLaw
from utank_hil.control.constrained.horizon import Horizon, Predictions, predictions
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.lqg import SHARES
from utank_hil.control.predictive.design import MOST_ORDER, MOST_SAMPLES
from utank_hil.dynamics import STATES, LinearModel
from utank_hil.retuning.estimate import MOST_BANDS, MotionEstimate

_MOST_OUTPUTS: Final = len(STATES)
MOST_STATES: Final = 68
MOST_KNOTS: Final = 40
MOST_PLANNED: Final = 150
"""Largest sizes of a law, condensed in milliseconds. A shipped one has 58 states, 19 knots, 60
samples; one for the longest delay, 1 s, has 68 states.
"""
_MOST_ITERATIONS: Final = 200  # This is three times the budget of the shipped laws.

MOST_NUMBERS: Final = (
    MOST_STATES * (2 + len(SHARES) + 3 * MOST_STATES + 2 * _MOST_OUTPUTS + MOST_KNOTS)
    + MOST_KNOTS * (1 + MOST_KNOTS + MOST_PLANNED * _MOST_OUTPUTS)
    + 2 * _MOST_OUTPUTS
)  #: Most numbers in the arrays of a message.
_MOST_REASONS: Final = 20
_MOST_CHARACTERS: Final = 500
"""Longest refusal in characters, about one screen of text; longer reasons are cut."""
OVERHEAD_BYTES: Final = 4096
"""Allowance for names, tags and shapes; a renewed law's, the largest, take some 600 bytes."""
LONGEST_BYTES: Final = OVERHEAD_BYTES + max(
    8 * (MOST_ORDER * (1 + _MOST_OUTPUTS) + MOST_SAMPLES * _MOST_OUTPUTS),
    8 * max(MOST_NUMBERS, 2 * MOST_BANDS),
    4 * _MOST_REASONS * _MOST_CHARACTERS,  # A character has up to four bytes.
)  #: Length of the longest answer that can be read.

_Shape = Annotated[tuple[Annotated[int, msgspec.Meta(ge=0, le=1 << 24)], ...],
                   msgspec.Meta(max_length=3)]  # fmt: skip


def encode(value: object) -> bytes:
    """Encode a struct, a dataclass or an array."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def decoder(kind: Any, *, finite: bool) -> msgspec.msgpack.Decoder[Any]:
    """Return a decoder whose `decode` raises a ValueError or RecursionError for any other type.

    `finite` refuses numbers in arrays that are not finite.
    """
    return msgspec.msgpack.Decoder(kind, dec_hook=_finite_array_in if finite else _array_in)


def refuse_shapes(*parts: tuple[str, FloatArray, tuple[int, ...]]) -> None:
    """Raise a ValueError for the first array whose shape is not the one given beside it."""
    for name, array, shape in parts:
        if array.shape != shape:
            raise ValueError(f"{name} has the shape {array.shape} in the place of {shape}")


def refuse_sizes(**sizes: tuple[int, int, int]) -> None:
    """Raise a ValueError for the first dimension outside of its range: value, least and most."""
    for name, (value, least, most) in sizes.items():
        if not least <= value <= most:
            raise ValueError(f"{name} must be {least} to {most}, got {value}")


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.shape, np.asarray(value, dtype="<f8").tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} does not pass between processes")


def _array_in(kind: type, value: object) -> FloatArray:  # noqa: ARG001 - msgspec's signature
    shape, data = msgspec.convert(value, tuple[_Shape, bytes])
    if 8 * math.prod(shape) != len(data):
        raise ValueError(f"{len(data)} bytes are no array of shape {shape}")
    return np.frombuffer(data, dtype="<f8").astype(np.float64).reshape(shape)


def _finite_array_in(kind: type, value: object) -> FloatArray:
    array = _array_in(kind, value)
    if not np.isfinite(array).all():
        raise ValueError("an array holds numbers that are not finite")
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A law that passed every check of the retuner.

    Raises `ValueError` if the law is too large for the loop, its gains do not fit together, or a
    number besides them is not finite.
    """

    law: PredictiveLaw
    washout_rad_s: float  #: Corner frequency of the washout; 0 for none.
    summary: ModelSummary

    def __post_init__(self) -> None:
        law = self.law
        order, samples = len(law.input_gains), len(law.reference_gains)
        outputs = law.output_gains.shape[-1]
        refuse_sizes(
            order=(order, 1, MOST_ORDER),
            samples=(samples, 1, MOST_SAMPLES),
            outputs=(outputs, 1, _MOST_OUTPUTS),
        )
        refuse_shapes(
            ("input_gains", law.input_gains, (order, 1, 1)),
            ("output_gains", law.output_gains, (order, 1, outputs)),
            ("reference_gains", law.reference_gains, (samples, 1, outputs)),
        )
        numbers = (self.washout_rad_s, law.sample_time_s, *astuple(self.summary))
        if not (all(map(math.isfinite, numbers)) and self.washout_rad_s >= 0):
            raise ValueError("the candidate's washout, sample time or summary is out of range")

    def whole_law(self) -> LinearLaw:
        """The law with its washout."""
        return WashoutLaw(self.law, self.washout_rad_s) if self.washout_rad_s else self.law


@dataclass(frozen=True, slots=True)
class Refusal:
    """Refusal of a new law, with one or more reasons in words."""

    reasons: Annotated[
        tuple[Annotated[str, msgspec.Meta(max_length=_MOST_CHARACTERS)], ...],
        msgspec.Meta(max_length=_MOST_REASONS),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class RenewedLaw:
    """A constrained law for the estimated waves and ship, with all margins."""

    law: ConstrainedLaw
    #: roll_rad, pressure_pa: root mean squares predicted in these waves, without limits.
    roll_rad: float
    pressure_pa: float
    passive_roll_rad: float  #: Predicted root mean square of the roll with the passive tank.


_CONDENSED: Final = {"knots", *Predictions._fields}
_OF_HORIZON: Final = [each.name for each in fields(Horizon) if each.name not in _CONDENSED]
_NOT_SENT: Final = ("horizon", "waves", "foresight")  # A renewed law takes no forecast.
_OF_LAW: Final = [each.name for each in fields(ConstrainedLaw) if each.name not in _NOT_SENT]
_PREDICTED: Final = [each.name for each in fields(RenewedLaw) if each.name != "law"]


class RenewedLawMessage(
    msgspec.Struct, frozen=True, eq=False, tag="renewed", forbid_unknown_fields=True
):
    """Message of a `RenewedLaw`; names and shapes as in `ConstrainedLaw` and `Horizon`."""

    model: LinearModel
    observer_gain: FloatArray
    knots: Annotated[tuple[int, ...], msgspec.Meta(min_length=1, max_length=MOST_KNOTS)]
    samples: Annotated[int, msgspec.Meta(ge=1, le=MOST_PLANNED)]
    output_weight: FloatArray
    input_weight: float
    first_output: Annotated[int, msgspec.Meta(ge=0, le=MOST_PLANNED)]
    terminal: FloatArray
    correction: FloatArray
    hessian: FloatArray
    unlimited_state: FloatArray
    unlimited_target: FloatArray
    limits: PumpLimits
    level_output: int | None
    level_penalty: float
    reservoir_area_m2: float
    steady_state: FloatArray
    steady_command: FloatArray
    iteration_limit: Annotated[int, msgspec.Meta(ge=1, le=_MOST_ITERATIONS)]
    gentler: FloatArray | None
    leeway: float | None
    roll_rad: float
    pressure_pa: float
    passive_roll_rad: float

    @classmethod
    def of(cls, renewed: RenewedLaw) -> "RenewedLawMessage":
        """Return the message of a law."""
        law, horizon = renewed.law, renewed.law.horizon
        return cls(
            knots=tuple(horizon.knots.tolist()),
            samples=len(horizon.interpolation),
            **{name: getattr(horizon, name) for name in _OF_HORIZON},
            **{name: getattr(law, name) for name in _OF_LAW},
            **{name: getattr(renewed, name) for name in _PREDICTED},
        )

    @property
    def answer(self) -> RenewedLaw:
        """Return the law; raises ValueError if its parts do not fit together or are not finite."""
        a, b, c, d, sample_time_s = self.model
        n, m, rest, knots = len(a), len(c), len(self.terminal), len(self.knots)
        refuse_sizes(
            states=(n, 1, MOST_STATES), outputs=(m, 1, _MOST_OUTPUTS), rest=(rest, 0, MOST_STATES)
        )
        refuse_shapes(
            ("A", a, (n, n)),
            ("B", b, (n, 1)),
            ("C", c, (m, n)),
            ("D", d, (m, 1)),
            ("observer_gain", self.observer_gain, (n, m)),
            ("output_weight", self.output_weight, (m,)),
            ("terminal", self.terminal, (rest, n)),
            ("correction", self.correction, (n,)),
            ("hessian", self.hessian, (knots, knots)),
            ("unlimited_state", self.unlimited_state, (knots, n)),
            ("unlimited_target", self.unlimited_target, (self.samples, knots, m)),
            ("steady_state", self.steady_state, (n, n)),
            ("steady_command", self.steady_command, (n,)),
        )
        if self.gentler is not None:
            refuse_shapes(("gentler", self.gentler, (len(SHARES) - 1, n)))
        predicted = [getattr(self, name) for name in _PREDICTED]
        if not (sample_time_s > 0 and all(map(math.isfinite, (sample_time_s, *predicted)))):
            raise ValueError("the sample time or what is predicted is not finite")
        with np.errstate(all="ignore"):
            motions = predictions(self.model, self.knots, self.samples)
        if not all(np.isfinite(each).all() for each in motions):
            raise ValueError("the answer's law is not finite")
        parts = {name: getattr(self, name) for name in _OF_HORIZON}
        horizon = Horizon(np.array(self.knots), *motions, **parts)
        law = ConstrainedLaw(horizon=horizon, **{name: getattr(self, name) for name in _OF_LAW})
        return RenewedLaw(law, *predicted)


Answer = Candidate | RenewedLaw | MotionEstimate | Refusal


class _CandidateMessage(msgspec.Struct, frozen=True, tag="candidate", forbid_unknown_fields=True):
    answer: Candidate


class _EstimateMessage(msgspec.Struct, frozen=True, tag="estimate", forbid_unknown_fields=True):
    answer: MotionEstimate


class _RefusalMessage(msgspec.Struct, frozen=True, tag="refusal", forbid_unknown_fields=True):
    answer: Refusal


_Message = _CandidateMessage | _EstimateMessage | _RefusalMessage | RenewedLawMessage
_DECODER: Final = decoder(_Message, finite=True)


def answer_bytes(answer: Answer) -> bytes:
    """Encode an answer for another process; long reasons are cut."""
    message: _Message
    match answer:
        case Candidate():
            message = _CandidateMessage(answer)
        case RenewedLaw():
            message = RenewedLawMessage.of(answer)
        case MotionEstimate():
            message = _EstimateMessage(answer)
        case Refusal():
            whole = (reason.encode(errors="replace").decode() for reason in answer.reasons)
            reasons = [reason[:_MOST_CHARACTERS] for reason in whole]
            message = _RefusalMessage(Refusal(tuple(reasons[:_MOST_REASONS])))
    return encode(message)


def read_answer(data: bytes) -> Answer:
    """Decode what `answer_bytes` encoded; `ValueError` for anything else."""
    try:
        message: _Message = _DECODER.decode(data)
    except RecursionError as error:
        raise ValueError("the answer is nested too deeply") from error
    return message.answer
