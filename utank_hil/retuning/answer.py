"""The retuner's answer: a law, an estimate of waves and ship, or a refusal with reasons.

All pass between processes as plain bytes. Decoding executes no code and rejects anything else, and
anything too large for the loop to read, to build and to step between two ticks.
"""

from dataclasses import dataclass, fields, replace
from typing import Final
from zlib import crc32

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import LinearLaw, PredictiveLaw
from utank_hil.control.predictive.design import MOST_ORDER, MOST_SAMPLES
from utank_hil.control.washout import WashoutLaw
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.retuning.estimate import MotionEstimate, ShipFigures
from utank_hil.retuning.number_reader import NumberReader
from utank_hil.retuning.renewed_law import MOST_NUMBERS, RenewedLaw

_CANDIDATE: Final = b"CANDIDAT"
_REFUSAL: Final = b"REFUSAL "
_ESTIMATE: Final = b"ESTIMATE"
_RENEWED: Final = b"RENEWED "
_CRC_BYTES: Final = 8
_REASONS_BYTES: Final = 4000
_MOST_REASONS: Final = 20
_MOST_OUTPUTS: Final = len(STATES)
_HEAD: Final = 6

LONGEST_BYTES: Final = 8 * max(
    1 + _HEAD + 9 + MOST_ORDER * (1 + _MOST_OUTPUTS) + MOST_SAMPLES * _MOST_OUTPUTS,
    1 + 1 + MOST_NUMBERS,
)
"""Of an answer that can be read: kind, head, summary and gains; or kind, check and numbers."""


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """The identified ship, and the law's predicted performance.

    Attributes
    ----------
    roll_period_s : float
        Natural roll period of the ship without tank water.
    period_deviation : float
        Relative standard deviation of that period.
    inertia_kg_m2, stiffness_nm_rad, damping_nms_rad : float
        Roll inertia, stiffness and linear damping of the ship.
    held_out_fit : float
        Worst one-step fit of an output on validation data.
    peak_sensitivity : float
        Peak of the sensitivity function on the identified ship.
    roll_below_passive : float
        Relative reduction of the roll RMS in the recorded waves, against the passive tank.
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

    def ship(self, configured: RollShip) -> RollShip:
        """The configured ship as she was identified."""
        return self.figures.ship(configured)

    def tank(self, configured: Tank) -> Tank:
        """The configured tank as it was identified."""
        return replace(configured, damping_ratio=self.tank_damping_ratio)

    @property
    def figures(self) -> ShipFigures:
        """The ship, for the change monitor; its stiffness is as uncertain as its square root is."""
        return ShipFigures(
            self.stiffness_nm_rad,
            self.inertia_kg_m2,
            self.damping_nms_rad,
            2 * self.period_deviation,
            self.period_deviation,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A law that passed every check of the retuner.

    Attributes
    ----------
    washout_rad_s : float
        Corner frequency of the washout; 0 for none.
    """

    law: PredictiveLaw
    washout_rad_s: float
    summary: ModelSummary

    def whole_law(self) -> LinearLaw:
        """The law with its washout."""
        return WashoutLaw(self.law, self.washout_rad_s) if self.washout_rad_s else self.law


@dataclass(frozen=True, slots=True)
class Refusal:
    """No new law.

    Attributes
    ----------
    reasons : tuple of str
        Why, in words; one or more.
    """

    reasons: tuple[str, ...]


Answer = Candidate | RenewedLaw | MotionEstimate | Refusal


def answer_bytes(answer: Answer) -> bytes:
    """Encode an answer for another process; long reasons are cut."""
    if isinstance(answer, Refusal):
        return _REFUSAL + "\n".join(answer.reasons).encode(errors="replace")[:_REASONS_BYTES]
    if isinstance(answer, MotionEstimate):
        return _ESTIMATE + answer.numbers().tobytes()
    if isinstance(answer, RenewedLaw):
        content = answer.numbers().tobytes()
        return _RENEWED + crc32(content).to_bytes(_CRC_BYTES, "little") + content
    law = answer.law
    order, inputs, outputs = law.output_gains.shape
    numbers: list[FloatArray | list[float]] = [
        [
            order,
            inputs,
            outputs,
            len(law.reference_gains),
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
            )
        ),
    ]
    return _CANDIDATE + np.concatenate(numbers).tobytes()


def read_answer(data: bytes) -> Answer:
    """Decode what `answer_bytes` encoded.

    Raises
    ------
    ValueError
        If `data` is anything else.
    """
    kind, content = data[:8], data[8:]
    if kind == _REFUSAL:
        reasons = content[:_REASONS_BYTES].decode(errors="replace").split("\n")
        return Refusal(tuple(reasons[:_MOST_REASONS]))
    if kind not in (_CANDIDATE, _ESTIMATE, _RENEWED) or len(content) % 8:
        raise ValueError("the answer is no law, estimate or refusal")
    if kind == _RENEWED:
        check, content = content[:_CRC_BYTES], content[_CRC_BYTES:]
        if int.from_bytes(check, "little") != crc32(content):
            raise ValueError("the answer's check sum is wrong")
        return RenewedLaw.of_numbers(np.frombuffer(content))
    if kind == _ESTIMATE:
        return MotionEstimate.of_numbers(np.frombuffer(content))
    values = NumberReader(np.frombuffer(content))
    order, inputs, outputs = values.size(MOST_ORDER), values.size(1), values.size(_MOST_OUTPUTS)
    horizon = values.size(MOST_SAMPLES)
    washout_rad_s, sample_time_s = values.take(2).tolist()
    summary = ModelSummary(*values.take(len(fields(ModelSummary))).tolist())
    law = PredictiveLaw(
        values.array(order, inputs, inputs),
        values.array(order, inputs, outputs),
        values.array(horizon, inputs, outputs),
        sample_time_s,
    )
    values.end()
    if not washout_rad_s >= 0:
        raise ValueError(f"the answer's washout is {washout_rad_s} rad/s")
    return Candidate(law, washout_rad_s, summary)
