"""Pump and valve as the controller commands them, and whether they follow."""

from typing import Final

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import NEVER_NS
from utank_hil.canbus import (
    Catalogue,
    ControlWord,
    DriveState,
    Frame,
    PumpCommand,
    SensorTank,
    ValveCommand,
    ValveControl,
    ValveStatus,
)
from utank_hil.canbus.measurements import Measurements
from utank_hil.canbus.profiles.device_plan import DevicePlan, MessageEncoder
from utank_hil.control.interface import VALVE
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.canopen_drive import CanopenDrive
from utank_hil.nodes.plausibility import MILLISECOND_NS, NEVER_HEARD_NS
from utank_hil.safety.situation import NO_VALVE, VALVE_OFF, Demand, Judgement, ValveReport

QUICK_STOPS: Final = 26
"""Commands, the first and half a second of them: a drive that brakes for longer, waits for a word
or stays in operation is told to be off."""
DISABLES: Final = 10
"""Commands that tell it so, after which it does not obey."""
AT_REST: Final = 10
"""Commands to a drive that neither drives nor brakes, after which it has stopped: one status in
between proves nothing of a drive whose enable chatters."""
RESETS: Final = 5
"""Commands that reset a fault of drive or valve: the first is the edge, some may be lost. Where its
cause lasts another edge is needed later, so the bit is taken back."""


_TOWARDS_ENABLED: Final[dict[DriveState | None, ControlWord]] = {
    DriveState.SWITCH_ON_DISABLED: ControlWord.SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: ControlWord.SWITCH_ON,
    DriveState.SWITCHED_ON: ControlWord.ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: ControlWord.ENABLE_OPERATION,
    DriveState.QUICK_STOP_ACTIVE: ControlWord.QUICK_STOP,
}
_STOPPING = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
"""Here the motor brakes; to disable the voltage would leave the rotor running down."""


class DriveSequence:
    """Chooses the control word of each pump command."""

    def __init__(self) -> None:
        self._resets_left = 0
        self._stops = self._rests = self._out = 0
        #: Whether the drive has been told to be off in vain, and was not seen off since.
        self.ignored = False

    def request_reset(self) -> None:
        """Reset the drive's fault with the next commands; only ever on an operator's order."""
        self._resets_left = RESETS

    def next_word(self, state: DriveState | None, *, wanted: bool) -> ControlWord:
        """Return the control word that leads from `state` towards operation enabled, or off.

        `state` is what the drive last reported, None if unknown; `wanted` says whether the
        supervisor wants the drive in operation enabled.
        """
        if self._resets_left and state is DriveState.FAULT:
            self._resets_left -= 1
            return ControlWord.FAULT_RESET
        self._resets_left = 0
        word = ControlWord.DISABLE_VOLTAGE
        if wanted:
            word = _TOWARDS_ENABLED.get(state, word)
        elif state in _STOPPING:
            word = ControlWord.QUICK_STOP
        if word is ControlWord.QUICK_STOP:
            self._stops += 1
            self._rests = 0
        else:
            self._rests += 1
            if wanted or self._rests >= AT_REST:
                self._stops = 0
        self._out = 0 if state in _STOPPING else self._out + 1
        if self._stops > QUICK_STOPS + DISABLES:
            self.ignored = True
        elif self._out >= AT_REST:  # not because it is to be on again
            self.ignored = False
        return ControlWord.DISABLE_VOLTAGE if self._stops > QUICK_STOPS else word


MOST_BEHIND: Final = 3
"""Commands that may have left since the one that is echoed; one or two have, if all is well."""
_COUNTER_MASK: Final = 15
"""Of a counter of four bits: 16 commands behind looks like none."""


class CommandEcho:
    """The newest command of which its receiver has sent the counter back.

    A receiver that gets every command, each a second late, sends new counters all the time. So an
    echo counts if it is new and not more than `MOST_BEHIND` commands behind. Before the first echo
    `heard_ns` is as given.
    """

    __slots__ = ("_counter", "_sent", "heard_ns")

    def __init__(self, heard_ns: int = NEVER_HEARD_NS) -> None:
        self.heard_ns = heard_ns  #: When the last echo came that counts.
        self._counter: int | None = None
        self._sent: int | None = None

    def sent(self, counter: int) -> None:
        """Note the counter of the command that leaves."""
        self._sent = counter

    def heard(self, counter: int | None, now_ns: int) -> None:
        """Take the counter in a status that came at `now_ns`; None where there is none yet."""
        if counter is None or counter == self._counter:
            return
        self._counter = counter
        if self._sent is not None and (self._sent - counter) & _COUNTER_MASK <= MOST_BEHIND:
            self.heard_ns = now_ns


STALE_MS: Final = 100.0
"""Where the valve stands is not known from an older report: VALVE_SILENT, and no more."""


class ValveCommander:
    """Turns the loss that a law asks for into VALVE_CMD, and watches the valve.

    The valve follows only while the law is in charge; else it goes to its fail position, as it does
    after a silence of `timeout_s`, which is sent with every command. `most_off` is the part of its
    way that it may be from where the commands should have brought it.
    """

    def __init__(
        self,
        valve: Valve,
        tank: Tank,
        catalogue: Catalogue,
        timeout_s: float,
        plan: DevicePlan[ValveStatus] | None = None,
        most_off: float = VALVE_OFF,
    ) -> None:
        command = None if plan is None else plan.command
        self._foreign = None if command is None else MessageEncoder(command)
        self._beat = None if plan is None else plan.beat
        self._valve = valve
        self._tank = tank
        self._sender = catalogue.transmitter(ValveCommand)
        self._timeout_s, self._most_off = timeout_s, most_off
        self._most_per_ns = 1e-9 / valve.opening_time_s
        self._level_period_s = catalogue.codec(SensorTank).cycle_ns * 1e-9
        self._inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
        self._asked = valve.fail_opening
        self._told = valve.fail_opening
        self._expected = valve.fail_opening
        self._following = False
        self._resets_left = 0
        self._followed_ns = self._at_place_ns = 0
        self._heard = False
        # a valve of another maker sends none: where it stands is what tells
        self._echo = CommandEcho() if plan is None else CommandEcho(NEVER_NS)

    def ask(self, loss: float) -> None:
        """Take the loss that the law wants, in Pa per (m/s)^2 of dh/dt."""
        self._asked = self._valve.opening(self._tank, max(loss, 0.0))

    def applied_loss(self, measured: Measurements) -> float:
        """The loss of the valve as it stands."""
        return self._valve.loss(self._tank, measured.valve_opening)

    def held_pa(self, measured: Measurements, rate_m_s: float) -> float:
        """Pressure that the valve takes from water at a level rate, for the level's observer.

        It is that of the rate at the end of a gauge's cycle: a step with the rate at its beginning
        is unstable where a valve slows the water faster than that.
        """
        damping_pa_s_m = self.applied_loss(measured) * abs(rate_m_s)
        slowed = 1.0 + damping_pa_s_m * self._level_period_s / self._inertia_pa_s2_m
        return damping_pa_s_m * rate_m_s / slowed

    def request_reset(self) -> None:
        """Reset the valve's fault with the next commands; only ever on an operator's order."""
        self._resets_left = RESETS

    def observe(self, measured: Measurements) -> ValveReport:
        """Look at the valve, once a tick."""
        now_ns, opening = measured.now_ns, measured.valve_opening
        self._echo.heard(measured.valve_echo, measured.valve_echo_ns)
        if not self._following or measured.valve_following:
            self._followed_ns = now_ns
        if not self._heard:  # it may stand anywhere at first, and runs from there
            self._heard = measured.valve_heard_ns > NEVER_HEARD_NS
            self._expected, self._looked_ns = opening, now_ns
        step, most = self._told - self._expected, self._most_per_ns * (now_ns - self._looked_ns)
        self._looked_ns = now_ns
        self._expected += min(max(step, -most), most)
        age_ms = (now_ns - measured.valve_heard_ns) / MILLISECOND_NS
        # pragma: no mutate start: a tick more or less, and it is never just that far off
        unknown = age_ms > STALE_MS  # others judge that
        if unknown or abs(opening - self._expected) <= self._most_off:
            # pragma: no mutate end
            self._at_place_ns = now_ns
        return ValveReport(
            age_ms,
            (now_ns - self._echo.heard_ns) / MILLISECOND_NS,
            measured.valve_fault,
            (now_ns - self._followed_ns) / MILLISECOND_NS,
            (now_ns - self._at_place_ns) / MILLISECOND_NS,
        )

    def frames(self, now_ns: int, *, faulted: bool, follow: bool) -> list[Frame]:
        """Return the next command; `faulted` says whether the valve reports a fault."""
        control = ValveControl.FOLLOW if follow else ValveControl.FAIL_POSITION
        if self._resets_left and faulted:
            control = ValveControl.RESET
            self._resets_left -= 1
        else:
            self._resets_left = 0
        self._following = control is ValveControl.FOLLOW
        self._told = self._asked if self._following else self._valve.fail_opening
        if self._foreign is not None:
            self._told = self._foreign.held(0, self._told)
            values = self._told, float(self._following), float(control is ValveControl.RESET)
            beat = [] if self._beat is None else [self._beat]
            return [*beat, self._foreign.frame(values, now_ns)]
        frame = self._sender.frame(ValveCommand(self._told, control, self._timeout_s))
        self._echo.sent(self._sender.counter)
        return [frame]


_CONTROL = Demand.CONTROL
_RAMP = Demand.RAMP


class Actuators:
    """What is on board of pump and valve.

    `timeout_s` is sent with every command: the drive stops on its own after so long a silence.
    `pump` says whether the tank has a pump; `valve` is None without a valve, `drive` without a
    drive of another maker. `limiting` says whether the limiter holds the law's pressure back.
    """

    def __init__(
        self,
        limiter: CommandLimiter,
        catalogue: Catalogue,
        timeout_s: float,
        *,
        pump: bool = True,
        valve: ValveCommander | None = None,
        drive: CanopenDrive | None = None,
    ) -> None:
        self.pump = pump
        self.valve, self.drive = valve, drive
        self._rate_m_s = 0.0
        self._now_ns = 0
        self.command_pa = 0.0  #: Pressure commanded.
        self._limiter = limiter
        self._timeout_s = timeout_s
        self._sequence = DriveSequence()
        self._commands = catalogue.transmitter(PumpCommand)
        self.cycle_ns = self._commands.cycle_ns  #: Time from one command to the next.
        self._echo = CommandEcho() if pump else CommandEcho(NEVER_NS)

    @property
    def limiting(self) -> bool:
        """Whether the command is not what the law asks for."""
        return self._limiter.limiting

    def observe(self, measured: Measurements) -> tuple[float, bool, ValveReport]:
        """Look at what came back, once a tick.

        Return the time in ms since the drive's echo of a new command, whether the drive was
        commanded off in vain, and the valve's report.
        """
        self._echo.heard(measured.drive_echo, measured.drive_echo_ns)
        echo_ns = self._echo.heard_ns if self.drive is None else self.drive.echo_ns
        return (
            (measured.now_ns - echo_ns) / MILLISECOND_NS,
            self.pump and self._sequence.ignored,
            NO_VALVE if self.valve is None else self.valve.observe(measured),
        )

    def held_pa(self, measured: Measurements, rate_m_s: float) -> float:
        """Pressure that a valve takes from water at a level rate; zero without one."""
        return 0.0 if self.valve is None else self.valve.held_pa(measured, rate_m_s)

    def note_applied(
        self, applied: FloatArray, names: tuple[str, ...], measured: Measurements
    ) -> None:
        """Write what left, and what was done of it, since the last call; shape (r,)."""
        mean_pa = self._limiter.mean_since_last_call()
        valve = self.valve
        for index, name in enumerate(names):
            applied[index] = (
                mean_pa if valve is None or name != VALVE else valve.applied_loss(measured)
            )

    def request_reset(self) -> None:
        """Reset faults of drive and valve with the next commands; only on an operator's order."""
        self._sequence.request_reset()
        if self.valve is not None:
            self.valve.request_reset()

    def limit(
        self, judgement: Judgement, wanted_pa: float, level: LevelObserver, share: float
    ) -> None:
        """Turn the law's pressure, or zero, into a permitted `command_pa`.

        `share` is the share of the greatest pressure that is allowed.
        """
        if not self.pump:
            return
        self._rate_m_s = level.rate_m_s
        if judgement.demand is _CONTROL:
            self.command_pa = self._limiter.limit(wanted_pa, level.level_m, level.rate_m_s, share)
        elif judgement.demand is _RAMP:
            self.command_pa = self._limiter.ramp_to_zero()
        else:
            self.command_pa = self._limiter.cut()

    def frames(self, judgement: Judgement, measured: Measurements) -> list[Frame]:
        """The next commands of what is on board."""
        word = self._sequence.next_word(measured.drive_state, wanted=judgement.drive_wanted)
        self._now_ns = measured.now_ns
        if self.drive is None:
            frames = self._pump_frames(word)
        else:
            frames = self.drive.command(self.command_pa, word, measured, self._rate_m_s)
        return frames + self._valve_frames(measured.valve_fault, judgement.demand is _CONTROL)

    def stop(self) -> list[Frame]:
        """Leave the pump at zero, the valve at its fail position."""
        self.command_pa = 0.0
        stops = (
            self._pump_frames(ControlWord.QUICK_STOP) if self.drive is None else self.drive.stop()
        )
        return stops + self._valve_frames(faulted=False, follow=False)

    def _pump_frames(self, word: ControlWord) -> list[Frame]:
        if not self.pump:
            return []
        command = self._commands.frame(PumpCommand(self.command_pa, word, self._timeout_s))
        self._echo.sent(self._commands.counter)
        return [command]

    def _valve_frames(self, faulted: bool, follow: bool) -> list[Frame]:
        if self.valve is None:
            return []
        return self.valve.frames(self._now_ns, faulted=faulted, follow=follow)
