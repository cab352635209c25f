"""The controller's side of the tank's valve: what is commanded, and whether it follows."""

from typing import Final

from utank_hil.base.tick import TICK_S
from utank_hil.canbus import Catalogue, Frame, SensorTank, ValveCommand, ValveControl
from utank_hil.canbus.measurements import Measurements
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.command_echo import CommandEcho
from utank_hil.nodes.drive_sequence import RESETS
from utank_hil.nodes.plausibility import MILLISECOND_NS, NEVER_HEARD_NS
from utank_hil.safety.situation import VALVE_OFF, ValveReport

STALE_MS: Final = 100.0
"""Where the valve stands is not known from an older report: VALVE_SILENT, and no more."""


class ValveCommander:
    """Turns the loss that a law asks for into VALVE_CMD, and watches the valve.

    The valve follows only while the law is in charge; else it goes to its fail position, as it does
    after a silence of `timeout_s`, which is sent with every command.
    """

    def __init__(self, valve: Valve, tank: Tank, catalogue: Catalogue, timeout_s: float) -> None:
        self._valve = valve
        self._tank = tank
        self._sender = catalogue.transmitter(ValveCommand)
        self._timeout_s = timeout_s
        self._most_step = TICK_S / valve.opening_time_s
        self._level_period_s = catalogue.codec(SensorTank).cycle_ns * 1e-9
        self._inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
        self._asked = valve.fail_opening
        self._told = valve.fail_opening
        self._expected = valve.fail_opening
        self._following = False
        self._resets_left = 0
        self._followed_ns = self._at_place_ns = 0
        self._heard = False
        self._echo = CommandEcho()

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
            self._expected = opening
        step = self._told - self._expected
        self._expected += min(max(step, -self._most_step), self._most_step)
        age_ms = (now_ns - measured.valve_heard_ns) / MILLISECOND_NS
        unknown = age_ms > STALE_MS  # others judge that
        if unknown or abs(opening - self._expected) <= VALVE_OFF:
            self._at_place_ns = now_ns
        return ValveReport(
            age_ms,
            (now_ns - self._echo.heard_ns) / MILLISECOND_NS,
            measured.valve_fault,
            (now_ns - self._followed_ns) / MILLISECOND_NS,
            (now_ns - self._at_place_ns) / MILLISECOND_NS,
        )

    def frame(self, *, faulted: bool, follow: bool) -> Frame:
        """Return the next command; `faulted` says whether the valve reports a fault."""
        control = ValveControl.FOLLOW if follow else ValveControl.FAIL_POSITION
        if self._resets_left and faulted:
            control = ValveControl.RESET
            self._resets_left -= 1
        else:
            self._resets_left = 0
        self._following = control is ValveControl.FOLLOW
        self._told = self._asked if self._following else self._valve.fail_opening
        frame = self._sender.frame(ValveCommand(self._told, control, self._timeout_s))
        self._echo.sent(self._sender.counter)
        return frame
