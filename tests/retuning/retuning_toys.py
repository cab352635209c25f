"""Laws, candidates and retuners for the tests of this folder and of faults."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from hypothesis import strategies as st

from utank_hil.canbus import Mode, OperatorCommand, RetuningOrder, RetuningState, Verdict
from utank_hil.control import PredictiveLaw
from utank_hil.retuning import (
    AdaptiveController,
    Answer,
    Candidate,
    ModelSummary,
    MotionEstimate,
    Pulses,
    RetuningSettings,
    ShipFigures,
)
from utank_hil.retuning.retuner import Request

SAMPLE_TIME_S = 0.2
SAMPLE_NS = 200_000_000
QUIET = OperatorCommand(Mode.ACTIVE, True, False, False, False)
SETTINGS = RetuningSettings(
    (6.0, 20.0), identification_s=10.0, trial_s=40.0, answer_within_s=4.0, alone=True
)
SUMMARY = ModelSummary(8.0, 0.01, 2e9, 1e9, 5e7, 0.1, 0.99, 1.2, 0.3)


def law_of(gain: float, order: int = 3, outputs: int = 1) -> PredictiveLaw:
    """u(k) = gain (y(k-1) + y(k-2) / 2 + ...), with a little memory of u."""
    output_gains = np.zeros((order, 1, outputs))
    output_gains[:, 0, 0] = gain * 0.5 ** np.arange(order)
    input_gains = np.full((order, 1, 1), 0.1)
    return PredictiveLaw(input_gains, output_gains, np.zeros((5, 1, outputs)), SAMPLE_TIME_S)


SHIP = ShipFigures(1e9, 2e9, 5e7, 0.02, 0.01)
TOLD_EVERY = 900


def candidate_of(gain: float, washout_rad_s: float = 0.0, **sizes: int) -> Candidate:
    return Candidate(law_of(gain, **sizes), washout_rad_s, SUMMARY)


@dataclass
class ToyRetuner:
    """Answers what it is told to, after so many looks; None never answers."""

    reply: Answer | None = None
    looks: int = 0
    alive: bool = True
    records: list[Any] = field(default_factory=list)

    def submit(self, number: int, record: Request, now_ns: int) -> None:
        self.number = number
        self.records.append(record)

    def answer(self, number: int, now_ns: int) -> Answer | None:
        assert number == self.number
        self.looks -= 1
        return self.reply if self.looks < 0 else None


class Rig:
    """An adaptive controller stepped as the node does it; the pump follows at once.

    `roll` is a function of the sample's number and of the command, `stiffness` of the number alone:
    by what factor the ship is stiffer than her law's.
    """

    def __init__(
        self,
        retuner: ToyRetuner,
        settings: RetuningSettings = SETTINGS,
        roll: Callable[[int, float], float] = lambda k, u: 0.02 * np.sin(0.1 * k),
        stiffness: Callable[[int], float] = lambda k: 1.0,
        pulse_roll_rad: float = 0.0,
    ) -> None:
        count = round(settings.identification_s / SAMPLE_TIME_S)
        self.pulses_pa = 1e3 * np.where(np.arange(count) % 7 < 3, 1.0, -1.0)
        law = law_of(1e5)
        self.controller = AdaptiveController(
            law,
            law.controller(),
            SHIP,
            0,
            settings,
            Pulses(self.pulses_pa, pulse_roll_rad),
            retuner,
        )
        self.roll = roll
        self.stiffness = stiffness
        self.samples = 0
        self.command_pa = 0.0
        self.commands: list[float] = []
        self.order = QUIET
        self._before: OperatorCommand | None = None
        self.engaged = self.fresh = True
        self.told = Verdict.GOOD

    def run(self, samples: int) -> None:
        for _ in range(samples):
            controller = self.controller
            if self.samples:
                controller.applied(np.array([self.command_pa]))
            order, before = self.order, self._before or self.order
            self._before = order
            pressed = RetuningOrder(
                order.retune and not before.retune,
                order.undo and not before.undo,
                order.forbid_retuning,
            )
            controller.update(
                self.samples * SAMPLE_NS, pressed, engaged=self.engaged, fresh=self.fresh
            )
            if self.samples % TOLD_EVERY == 0:
                found = replace(SHIP, stiffness_nm_rad=self.stiffness(self.samples) * 1e9)
                controller.note(MotionEstimate(Verdict.GOOD, self.told, found))
            y = np.array([self.roll(self.samples, self.command_pa)])
            self.command_pa = float(controller.step(y)[0])
            self.commands.append(self.command_pa)
            self.samples += 1

    def press(self, **buttons: bool) -> None:
        """Press and hold buttons from the next sample on, for three samples, and let them go."""
        if self.samples == 0:  # what is pressed before the first look is no press
            self.run(1)
        self.order = QUIET._replace(**buttons)  # type: ignore[arg-type]
        self.run(3)
        self.order = QUIET

    def run_until(self, state: object, most: int = 3000) -> None:
        while self.controller.state is not state:
            assert most > 0, f"still {self.controller.state.name}"
            self.run(1)
            most -= 1

    def retune_until(self, state: object, *, after: int = 300) -> None:
        """Order a retuning after so many samples, and go on until a state."""
        self.run(after)
        self.press(retune=True)
        self.run_until(state)

    def answers_of_the_first_law(self) -> list[float]:
        """Of the law that was configured, to the same roll after the same commands."""
        law, answers = law_of(1e5).controller(), []
        for k, before in enumerate([0.0, *self.commands[:-1]]):
            if k:
                law.applied(np.array([before]))
            answers.append(float(law.step(np.array([self.roll(k, before)]))[0]))
        return answers

    @property
    def reasons(self) -> str:
        return "; ".join(self.controller.events[-1].reasons)


def states(rig: Rig) -> list[RetuningState]:
    return [event.state for event in rig.controller.events]


def scribble(content: Any, data: st.DataObject, values: list[float]) -> None:
    """Overwrite a number of a decoded message, or a few in an array, with one of `values`."""
    places = list(_places(content))
    holder, key = data.draw(st.sampled_from(places))
    value = data.draw(st.sampled_from(values))
    if isinstance(holder[key], bytes):
        numbers = np.frombuffer(holder[key]).copy()
        begin = data.draw(st.integers(0, max(0, len(numbers) - 1)))
        numbers[begin : begin + data.draw(st.integers(1, 6))] = value
        holder[key] = numbers.tobytes()
    else:
        holder[key] = value


def _places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Where the numbers and arrays of a decoded message stand."""
    items = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in list(items):
        if isinstance(value, dict | list):
            yield from _places(value)
        elif isinstance(value, bytes | float):
            yield content, key
