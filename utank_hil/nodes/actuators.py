"""Pump and valve as the controller commands them."""

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Catalogue, ControlWord, Frame, PumpCommand
from utank_hil.canbus.measurements import Measurements
from utank_hil.control.interface import VALVE
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter
from utank_hil.nodes.canopen_drive import CanopenDrive
from utank_hil.nodes.command_echo import CommandEcho
from utank_hil.nodes.drive_sequence import DriveSequence
from utank_hil.nodes.plausibility import MILLISECOND_NS
from utank_hil.nodes.valve_command import ValveCommander
from utank_hil.safety.judgement import Judgement
from utank_hil.safety.situation import NO_VALVE, ValveReport
from utank_hil.safety.supervisor import Demand

_CONTROL = Demand.CONTROL
_RAMP = Demand.RAMP
_ABSENT_NS = 1 << 62


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
        self.command_pa = 0.0  #: Pressure commanded.
        self._limiter = limiter
        self._timeout_s = timeout_s
        self._sequence = DriveSequence()
        self._commands = catalogue.transmitter(PumpCommand)
        self.cycle_ns = self._commands.cycle_ns  #: Time from one command to the next.
        self._echo = CommandEcho() if pump else CommandEcho(_ABSENT_NS)

    @property
    def limiting(self) -> bool:
        """Whether the command is not what the law asks for."""
        return self._limiter.limiting

    def observe(self, measured: Measurements) -> tuple[float, bool, ValveReport]:
        """Look at what came back, once a tick.

        Return the time in ms since the drive's echo of a new command, whether the drive was
        commanded off in vain, and the valve's report.
        """
        if self.drive is None:
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
            if name == VALVE and valve is not None:
                applied[index] = valve.applied_loss(measured)
            else:
                applied[index] = mean_pa

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
        frames = self._valve_frames(
            faulted=measured.valve_fault, follow=judgement.demand is _CONTROL
        )
        if self.drive is None:
            return self._pump_frames(word) + frames
        return self.drive.command(self.command_pa, word, measured, self._rate_m_s) + frames

    def stop(self) -> list[Frame]:
        """Leave the pump at zero, the valve at its fail position."""
        self.command_pa = 0.0
        frames = self._valve_frames(faulted=False, follow=False)
        if self.drive is None:
            return self._pump_frames(ControlWord.QUICK_STOP) + frames
        return self.drive.stop() + frames

    def _pump_frames(self, word: ControlWord) -> list[Frame]:
        if not self.pump:
            return []
        command = self._commands.frame(PumpCommand(self.command_pa, word, self._timeout_s))
        self._echo.sent(self._commands.counter)
        return [command]

    def _valve_frames(self, *, faulted: bool, follow: bool) -> list[Frame]:
        return [] if self.valve is None else [self.valve.frame(faulted=faulted, follow=follow)]
