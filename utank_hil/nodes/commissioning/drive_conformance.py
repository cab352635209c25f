"""Puts a drive by CiA 402 through its profile: set-up, what it must refuse, time to stop."""

import math
from typing import Final

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import ControlWord, DriveState, Frame
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.canopen import (
    SDO_ANSWER,
    SDO_REQUEST,
    SENT_1,
    SENT_2,
    Answer,
    Place,
    answer,
    read_request,
    write_request,
)
from utank_hil.canbus.profiles.drive_plan import COMMAND_MS, SPEED, STATUS_WORD, DrivePlan
from utank_hil.dynamics.pump import Pump
from utank_hil.nodes.canopen_drive import CanopenDrive, state_of
from utank_hil.nodes.commissioning.checks import Check
from utank_hil.nodes.commissioning.conformance import SECOND_NS, Ask, Script, Trial, flag
from utank_hil.nodes.drive_sequence import DriveSequence

STOP_MS: Final = 130.0 + COMMAND_MS
"""From the controller's last frame, as the native drive (docs/safety.md); a PDO tells it late."""
SHARE: Final = 0.2  #: Of the greatest torque or speed, for a second: it moves the water by little.
TURN_S: Final = 1.0
SETTLED_S: Final = 0.5  #: After it the rotor turns with the water that it has moved.
STOPPED: Final = 0.1  #: Of the fall of its speed until then.
RUNS_ON: Final = 0.5  #: Of the speed before: no stop. The water turned it at 0.2 on the bench.
CONFIGURED_S: Final = 15.0  #: Some forty entries at 0.3 s each, as slow as a server may be.
STATE_S: Final = 2.0  #: For a change of state; a drive that charges its capacitors takes one.
IDENTITY: Final = Place(0x1018, 1)  #: Read-only by CiA 301.
_ENABLED: Final = DriveState.OPERATION_ENABLED


class DriveTrial(Trial):
    """A drive with its pump in still water; it is left braked, and its node stopped."""

    def __init__(self, plan: DrivePlan, pump: Pump, ask: Ask) -> None:
        self._plan, self._drive = plan, CanopenDrive(plan)
        self._target = SHARE * (pump.max_torque_nm if plan.mode.torque else pump.max_speed_rad_s)
        self._word, self._pushes, self._speaks = ControlWord.DISABLE_VOLTAGE, False, True
        self._tag = plan.bus << BUS_SHIFT | STANDARD
        self._answer: Answer | None = None
        self._state: DriveState | None = None
        self._speed_rad_s = math.nan
        super().__init__(ask)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take what is the drive's; what it says by SDO counts as what it says by PDO."""
        take = self._drive.takes.get(frame.can_id)
        if take is None:
            return
        take(frame, now_ns)
        cob = (frame.can_id ^ self._tag) - self._plan.node
        if cob == SENT_1:
            self._state = self._drive.state
        elif cob == SENT_2:
            self._speed_rad_s = self._drive.speed_rad_s
        elif cob == SDO_ANSWER and (got := answer(frame.data)) is not None:
            self._answer = got
            if got.place == STATUS_WORD and got.value is not None:
                self._state = state_of(got.value)
            elif got.place == SPEED and got.value is not None:
                speed = (got.value ^ 1 << 31) - (1 << 31)
                self._speed_rad_s = speed * self._plan.speed_rad_s_per_unit

    def stop(self, now_ns: int) -> list[Frame]:  # noqa: ARG002
        """Leave the drive braking, however the trial ends."""
        return self._drive.stop()

    def _frames(self) -> list[Frame]:
        cycle = self.now_ns // TICK_NS % (COMMAND_MS * 1_000_000 // TICK_NS)
        if self._speaks:
            frames = self._drive.frames(self.now_ns)
            return frames if cycle else frames + self._command()
        if cycle:
            return []
        # A dead controller sends nothing. SYNC and SDO are no sign of its life; they show how the
        # drive stops, in the state of its node that 1029h chooses, too.
        place = (SPEED, STATUS_WORD)[self.now_ns // (COMMAND_MS * 1_000_000) % 2]
        return [*self._command()[1:-1], self._request(read_request(place))]

    def _command(self) -> list[Frame]:
        return self._drive.follow(self._target if self._pushes else 0.0, self._word)

    def _request(self, data: bytes) -> Frame:
        return Frame(self._tag | SDO_REQUEST + self._plan.node, data)

    def script(self) -> Script:
        """Configure, try what must be refused, turn and stop in two ways."""
        setup = self._drive.setup
        yield from self._by_hand("The pump will turn: water and ship still, nobody at the shaft")
        yield from self._wait(CONFIGURED_S, lambda: setup.done or bool(setup.problem))
        why = setup.problem or f"node {self._plan.node} does not answer: look at bus and node"
        said = "configured by SDO, read back, started"
        self.checks.append(flag("set_up", said, why, right=setup.done))
        if not setup.done:
            return
        yield from self._wait(STATE_S, lambda: self._state is DriveState.SWITCH_ON_DISABLED)
        yield from self._refusals()
        yield from self._stop("quick_stop", "quick stop to standstill", speaks=True)
        yield from self._stop(
            "lost_controller", "controller's last frame to standstill", speaks=False
        )

    def _refusals(self) -> Script:
        self._word = ControlWord.ENABLE_OPERATION
        yield from self._wait(10 * COMMAND_MS * 1e-3)
        self.checks.append(
            flag("leap", "it is not enabled out of its order of states",
                 "By CiA 402-2 it goes through ready and switched on: look at its settings.",
                 right=self._state is not _ENABLED)
        )  # fmt: skip
        self._word, self._answer = ControlWord.DISABLE_VOLTAGE, None
        yield [self._request(write_request(IDENTITY, 0, 4))]
        yield from self._wait(STATE_S, lambda: self._answer is not None)
        refused = self._answer is not None and self._answer.abort != 0
        remedy = "1018h must be read-only: anything could pass for this drive."
        self.checks.append(
            flag("read_only", "its identity can't be written", remedy, right=refused)
        )

    def _stop(self, name: str, what: str, *, speaks: bool) -> Script:
        sequence = DriveSequence()
        sequence.request_reset()
        end_ns = self.now_ns + round(2 * STATE_S * SECOND_NS)
        while self._state is not _ENABLED and self.now_ns < end_ns:
            self._word = sequence.next_word(self._state, wanted=True)
            yield from self._wait(2 * COMMAND_MS * 1e-3)
        if self._state is not _ENABLED:
            remedy = f"It stays {self._drive.words}: look at supply, enable input and fault."
            self.checks.append(flag(f"{name}_enabled", "it can be enabled", remedy, right=False))
            return
        self._pushes = True
        yield from self._wait(TURN_S)
        speed_rad_s = self._speed_rad_s
        turns = speed_rad_s * self._target > 0
        remedy = "Look at the sign of pressure_pa_per_unit or speed_rad_s_per_unit, and the echo."
        said = f"it turns as commanded, {speed_rad_s:.3g} rad/s"
        self.checks.append(flag(f"{name}_turns", said, remedy, right=turns))
        self._pushes, self._word, self._speaks = False, ControlWord.QUICK_STOP, speaks
        shares: list[float] = []
        end_ns = self.now_ns + round(SETTLED_S * SECOND_NS)
        while self.now_ns < end_ns:
            shares.append(self._speed_rad_s / speed_rad_s if turns else math.nan)
            yield self._frames()
        end = shares[-1]
        above = [place for place, each in enumerate(shares) if each > end + STOPPED * (1 - end)]
        stopped_ms = (max(above, default=0) + 1) * TICK_NS * 1e-6
        self.checks.append(
            Check(f"{name}_ms", what, stopped_ms if end <= RUNS_ON else math.nan, 0.0, STOP_MS,
                  "ms", "Shorten heartbeat_ms and the ramp of the stop (6085h); see 6007h, 605Ah.")
        )  # fmt: skip
        yield from self._wait(STATE_S / 2)
        remedy = "It must not run on: set 6007h, 605Ah and 605Eh, or take another drive."
        off = self._state is not _ENABLED
        self.checks.append(flag(f"{name}_off", "it is off afterwards", remedy, right=off))
        self._speaks, self._word = True, ControlWord.DISABLE_VOLTAGE
