"""The way of one command of a replay: frames in, the controller's values, the law, frames out."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Frame, load_catalogue
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import SIGNALS, shown_by
from utank_hil.telemetry.law_values import Values, differences, law_values

_FEW: Final = 20  #: Elements of a long array that are listed each.
NONE: Final = "none"


def said(value: object) -> str:
    """Return a value exactly as text, a member of an enumeration by its name."""
    return str(getattr(value, "name", None) or repr(value))


class Number(NamedTuple):
    """A value of the explained tick, exact as text; what was not recorded stands under replayed."""

    stage: str  #: "received", "controller", "law" or "sent".
    name: str
    recorded: str
    replayed: str


class ExplainedTick:
    """Takes the `numbers` of a `tick` of a replay, from 0; `ended` if the replay came to it."""

    def __init__(self, tick: int) -> None:
        self.tick = tick
        self.numbers: list[Number] = []
        self.ended = False
        self._before: Values = {}

    def received(self, frame: Frame) -> None:
        """Take a frame that came in before the tick."""
        for name, value in self._signals(frame).items():
            self.numbers.append(Number("received", name, value, value))

    def begin(self, node: ControllerNode) -> None:
        """Take the law's numbers before the tick."""
        self._before = {name: np.copy(value) for name, value in law_values(node.law.law).items()}

    def end(self, node: ControllerNode, recorded: Sequence[Frame], sent: Sequence[Frame]) -> None:
        """Take the controller's values after the tick, and the frames of both runs."""
        self.ended = True
        values = dict(zip(SIGNALS, shown_by(node), strict=True))
        values["law_pressure_pa"] = node.law.pressure_pa
        values["pressure_share"] = node.law.share(node.judgement)
        self.numbers += [Number("controller", name, "", said(x)) for name, x in values.items()]
        now = law_values(node.law.law)
        changed = {each.name.partition("[")[0] for each in differences(self._before, now)}
        for name in sorted(changed & now.keys()):
            self.numbers += _of_array(name, self._before.get(name), now[name])
        before, again = self._all_signals(recorded), self._all_signals(sent)
        for name in dict.fromkeys((*before, *again)):
            both = before.get(name, NONE), again.get(name, NONE)
            self.numbers.append(Number("sent", name, *both))

    def _all_signals(self, frames: Sequence[Frame]) -> dict[str, str]:
        return {name: value for frame in frames for name, value in self._signals(frame).items()}

    def _signals(self, frame: Frame) -> dict[str, str]:
        """Signals of a frame by name; its bytes if it is none of the catalogue, or damaged."""
        message = load_catalogue().decoded(frame)
        if message is None:
            return {f"{frame.can_id:08X}": frame.data.hex(" ")}
        name = load_catalogue().by_id[frame.can_id].codec.name
        return {f"{name}.{field}": said(getattr(message, field)) for field in message._fields}


def _of_array(name: str, before: FloatArray | None, now: FloatArray) -> list[Number]:
    """A changed array; of a long one, as a memory of samples, only the elements that changed."""
    if before is not None and before.shape == now.shape:
        places = np.argwhere(before != now)
        if len(places) < _FEW < now.size:
            return [
                Number("law", f"{name}{place.tolist()}", "", said(now[tuple(place)].item()))
                for place in places
            ]
    return [Number("law", name, "", said(now.tolist()))]
