"""Devices of other makers that do more than measure: a valve, an operator station."""

import math
import os
from collections.abc import Callable, Sequence
from hmac import compare_digest
from typing import Any, Final

from utank_hil.base.tick import LONG_AGO_NS
from utank_hil.canbus.cmac import cmac
from utank_hil.canbus.endpoints import Rejection
from utank_hil.canbus.enumerations import Mode, ValveFault, ValveState
from utank_hil.canbus.frame import Frame
from utank_hil.canbus.messages import OperatorCommand, ValveStatus
from utank_hil.canbus.profiles.device import CalledTaker, MessageHeard, ProfiledDevice, hear
from utank_hil.canbus.profiles.device_plan import FIELDS, DevicePlan


class ProfiledValve(ProfiledDevice[ValveStatus]):
    """A valve: where it stands, by its position or by the switches at both ends of its way.

    Between these its position is not known. One that is not known to be the ship's says nothing.
    """

    def _content(self, usable: bool) -> tuple[Any, ...] | None:
        if not self.named:
            return None
        opening, is_open, is_shut = self._values
        if not (math.isnan(is_open) and math.isnan(is_shut)):
            at_an_end = (is_open == 1.0) != (is_shut == 1.0)
            opening = float(is_open == 1.0) if at_an_end else math.nan
        state = ValveState.FOLLOWING if usable else ValveState.FAULT
        return (opening, state, ValveFault.NONE, None, None, False, False, False)


PROOF: Final = 8  #: Bytes of challenge and proof: what a classic frame holds.
TRY_NS: Final = 50_000_000
"""Between two proofs that are tried: who floods the bus with them takes no time of the tick."""
WRONG: Final = 3
"""Wrong proofs in succession, from which on they are told: a challenge may change under way."""
_STOP: Final = FIELDS[OperatorCommand].index("stop")


class ProfiledPanel(ProfiledDevice[OperatorCommand]):
    """An operator station: what is pressed, and whether it lives.

    Only a panel that is known, well and alive is delivered. A stop, and what disarms, is told to
    `overhear` from any whole frame, whatever else is wrong with it. A stop that is not available
    counts as pressed, another button as not.

    With a `key`, where the plan asks for one, `arm` is `proved` once the panel has answered the
    last challenge for a frame that has it, and until it is let go: before, `Orders` does not count
    it. Stop is never authenticated.
    """

    def __init__(self, plan: DevicePlan[OperatorCommand], key: bytes = b"") -> None:
        super().__init__(plan)
        self._key, self._said, self._tried_ns = key, b"", LONG_AGO_NS
        self.nonce = os.urandom(PROOF)  #: The challenge; the next follows from it by the key.
        self.proved = plan.authentication is None
        self._wrong = 0  # proofs in succession
        self._arms = self._asked = False
        if plan.authentication is not None:
            for can_id in plan.authentication.proof_ids:
                hear(self.takers, can_id, CalledTaker(self._take_proof))
        self.overhear: Callable[[OperatorCommand], None] = lambda _: None
        self._values[_STOP] = 0.0  # nothing is pressed before it is heard

    @property
    def rejected(self) -> dict[Rejection, int]:
        """Frames of its messages that were not accepted, by reason."""
        return {
            reason: sum([each.rejected[reason] for each in self._needed]) for reason in Rejection
        }

    def changed(self, new: bool) -> None:
        """Count a frame that came because its content is new."""
        for message in self._needed:
            message.changes += new

    def take(self, message: MessageHeard, frame: Frame, now_ns: int) -> None:
        """Take a frame of one of its messages."""
        if message.signals and message.intact(frame.data) and not message.is_another(frame.data):
            values = list(self._values)
            for signal in message.signals:
                values[signal.place] = signal.value(frame.data)
            order = _order(values)
            self.overhear(order)
            self._said = frame.data
            if not order.arm and self._arms and self.plan.authentication is not None:
                self.proved = False
                self._renew()  # what was said for it and not used is worth nothing
            self._arms = order.arm
        super().take(message, frame, now_ns)

    def _take_proof(self, frame: Frame, now_ns: int) -> None:
        """Try a proof of the last order, one in `TRY_NS`; a challenge that was met is used up."""
        if self.proved or not (self._arms and self._key) or now_ns - self._tried_ns < TRY_NS:
            return
        self._tried_ns = now_ns
        if compare_digest(cmac(self._key, self.nonce + self._said)[:PROOF], frame.data):
            self.proved, self._wrong = True, 0
            self._renew()
            self.overhear(_order(self._values))  # there is something new in it
        else:
            self._wrong += 1
            if self._wrong >= WRONG:
                self._needed[0].rejected[Rejection.PROOF] += 1

    def wake(self, now_ns: int) -> Frame | None:
        """What is to be sent to it: the challenge, where it has to be met."""
        authentication = self.plan.authentication
        if authentication is None or not self.named:
            return super().wake(now_ns)
        if self._asked:
            self._renew()
        self._asked = True
        return Frame(authentication.challenge_id, self.nonce)

    def _renew(self) -> None:
        """Take the next challenge: only who has the key knows it beforehand."""
        self.nonce = cmac(self._key, self.nonce)[:PROOF]

    def _content(self, usable: bool) -> tuple[Any, ...] | None:
        return tuple(_order(self._values)) if usable else None


def _order(values: Sequence[float]) -> OperatorCommand:
    arm, stop, acknowledge, reset, passive = [each == 1.0 for each in values]
    stop = values[_STOP] != 0.0
    mode = Mode.STANDBY if stop else Mode.ACTIVE if arm else Mode.PASSIVE
    if mode is Mode.PASSIVE and not passive:
        mode = Mode.STANDBY
    return OperatorCommand(mode, arm, stop, reset, acknowledge)


def device_of(plan: DevicePlan[Any], key: bytes = b"") -> ProfiledDevice[Any]:
    """What hears the device of a plan; a panel with its key."""
    if plan.kind is ValveStatus:
        return ProfiledValve(plan)
    return ProfiledPanel(plan, key) if plan.kind is OperatorCommand else ProfiledDevice(plan)
