"""The retuner's answer: a law, an estimate of waves and ship, or a refusal with reasons.

Answers pass between processes as typed messages (`wire`). Decoding rejects anything else, and
anything too large for the loop to read, build and step between two ticks.
"""

import math
from dataclasses import astuple, dataclass
from typing import Annotated, Final

import msgspec

from utank_hil.canbus.events import ModelSummary
from utank_hil.control import LinearLaw, PredictiveLaw, WashoutLaw
from utank_hil.control.predictive.design import MOST_ORDER, MOST_SAMPLES
from utank_hil.dynamics import STATES
from utank_hil.retuning.estimate import MOST_BANDS, MotionEstimate
from utank_hil.retuning.renewed_law import MOST_NUMBERS, RenewedLaw, RenewedLawMessage
from utank_hil.retuning.wire import OVERHEAD_BYTES, decoder, encode, refuse_shapes, refuse_sizes

_MOST_REASONS: Final = 20
_MOST_CHARACTERS: Final = 500
"""Longest refusal in characters, about one screen of text; longer reasons are cut."""
_MOST_OUTPUTS: Final = len(STATES)

LONGEST_BYTES: Final = OVERHEAD_BYTES + max(
    8 * (MOST_ORDER * (1 + _MOST_OUTPUTS) + MOST_SAMPLES * _MOST_OUTPUTS),
    8 * max(MOST_NUMBERS, 3 * MOST_BANDS),
    4 * _MOST_REASONS * _MOST_CHARACTERS,  # A character has up to four bytes.
)  #: Length of the longest answer that can be read.


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
    """Decode what `answer_bytes` encoded.

    Raises `ValueError` if `data` is anything else.
    """
    try:
        message: _Message = _DECODER.decode(data)
    except RecursionError as error:
        raise ValueError("the answer is nested too deeply") from error
    return message.answer
