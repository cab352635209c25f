"""Emulated ship: ship, tank and pump in waves, integrated up to a given time."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from firmware_sim import plant_kernel as kernel
from firmware_sim.waves import AHEAD_TICKS, SteadyWaves, Waves
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.dynamics.hull.lateral import LateralHull, LateralModel
from utank_hil.dynamics.kernels import MAX_IMPULSE, STRIKES
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.dynamics.valves import LOCKED, locked_loss
from utank_hil.sea import Harmonics

SAILING_TICKS = 100  #: Ticks between updates of the ship's parameters: 1 s.


class Equations(NamedTuple):
    """Numbers of the kernel's equations, see `plant_kernel.advance_tick`."""

    row: FloatArray
    restoring: FloatArray
    pump: tuple[float, ...]  #: `PumpCoefficients`.
    ahead: FloatArray  #: Waves' roll moment and lateral acceleration at `MOMENTS`, (2, 4).
    phasors: ComplexArray
    rotations: ComplexArray


class Plant:
    """Ship, tank and pump in waves, integrated at 1 kHz by the nonlinear equations.

    The ship is upright and at rest at the first `advance`; off-centre weight and steady wind heel
    it from then on. Water that reaches a limit of the level strikes it. A ship that passes 90
    degrees has capsized and stays there. The pump follows its set-point through its own pressure
    loop. Switched off, its rotor turns freely in the water.

    Parameters
    ----------
    ship : RollShip or callable
        The ship, or a function of the time in s since the start, evaluated once a second.
    pump : Pump or None
        None for a tank without one.
    waves : Waves or Harmonics
        Roll moment of the waves in N m, lateral acceleration over g if the ship sways, and change
        of the righting moment as a share if it has one, from the plant's start on.
    linear : bool
        Whether to integrate the small-angle limit: no quadratic loss, level limit or capsizing.
    hull : LateralHull, optional
        Hull of a ship that is free to sway and yaw; the waves are then sway force, roll and yaw
        moment, and the righting moment's change if it has one.
    six : bool
        Whether the hull is free to surge, heave and pitch, too; their forces follow the yaw moment.
    turning : callable, optional
        Roll moment in N m, and lateral acceleration over g, besides those of the waves, as a
        function of the time in s; the waves then have a lateral acceleration, if of zero.
    """

    def __init__(
        self,
        ship: RollShip | Callable[[float], RollShip],
        tank: Tank,
        pump: Pump | None,
        waves: Waves | Harmonics,
        *,
        linear: bool = False,
        hull: LateralHull | None = None,
        six: bool = False,
        turning: Callable[[float], tuple[float, float]] | None = None,
    ) -> None:
        self._turning = turning
        self._ship_at = ship if callable(ship) else None
        self._ship = ship(0.0) if callable(ship) else ship
        self._tank = tank
        self._linear = linear
        self._lateral = None if hull is None else LateralModel(hull, self._ship, tank, six)
        self._load(self._ship)
        self._area_m2 = tank.reservoir_area_m2
        self._locked_loss = locked_loss(tank)
        self._has_pump = pump is not None
        self._pump = pump or Pump.for_duct(tank.duct_area_m2)  # without effect if there is none
        self._coefficients = tuple(self._pump.coefficients)
        self._weights = kernel.interpolation_weights()
        self._waves = SteadyWaves(waves) if isinstance(waves, Harmonics) else waves
        self._state = np.zeros(kernel.STATES)
        self._state[kernel.CAPSIZED] = math.inf
        self._state[kernel.MODE] = kernel.ABSENT if pump is None else kernel.FREE
        self._ticks = 0
        phasors, rotations = self._waves.begin()
        ahead = [self._state[each] for each in (kernel.MOMENTS, kernel.SWAY, kernel.CHANGE)]
        if self._lateral is not None:
            self._oscillators = self._lateral.oscillators, self._lateral.vertical
            self._x = np.zeros(self._lateral.states)
            self._ahead = np.zeros((8 if six else 5, 4))
            ahead = list(self._ahead)
        for index in range(4):
            for wave, phasor, rotation in zip(ahead, phasors, rotations, strict=False):
                wave[index] = kernel.turned_sum(phasor, rotation)
        self._show()
        self._now_ns: int | None = None
        #: Injected fault: function that gives the pressure of an enabled pump instead of its set-
        #: point.
        self.broken_pump: Callable[[float], float] | None = None
        self.presses_off = False  #: Whether that fault also acts while the pump is not enabled.
        self._cuts: set[str] = set()

    def _load(self, ship: RollShip) -> None:
        tank = self._tank
        self._linear_model = np.zeros((0, 8))
        if self._linear:
            a, b = state_matrices(ship, tank)
            heel = b[:, 1:] * ship.heeling_moment_nm
            push_pa = tank.density_kg_m3 * GRAVITY_M_S2 * tank.width_m  # per acceleration over g
            lever_nm = GRAVITY_M_S2 * tank.water_lever_kgm
            self._linear_model = np.hstack([a, b, heel, b[:, 1:] * lever_nm - b[:, :1] * push_pa])
            ship = replace(ship, quadratic_damping_nms2_rad2=0.0)
            tank = replace(tank, quadratic_loss=0.0)
        model = RollModel(ship, tank)
        self._per_piece = 1 / model.restoring.piece_rad
        self._row: FloatArray = np.array([*model.coefficients, self._per_piece])
        if self._lateral is not None:
            self._row = self._lateral.packed(ship)
        self._restoring = model.restoring.coefficients_nm

    def advance(self, now_ns: int) -> None:
        """Integrate up to `now_ns`, in whole ticks after the first call."""
        if self._now_ns is None:
            self._now_ns = now_ns
        if now_ns - self._now_ns < TICK_NS:
            return
        while now_ns - self._now_ns >= TICK_NS:
            if self._ship_at is not None and self._ticks % SAILING_TICKS == 0:
                ship = self._ship_at(self._ticks * TICK_S)
                if ship != self._ship:
                    self._ship = ship
                    self._load(ship)
            phasors, rotations = self._waves.at(self._ticks)
            self._tick(phasors, rotations)
            if self._turning is not None:
                # the tick has moved the waves on to three ticks after its start
                turned = self._turning((self._ticks + 1 + AHEAD_TICKS) * TICK_S)
                if self._lateral is None:
                    self._state[kernel.MOMENTS][3] += turned[0]
                    self._state[kernel.SWAY][3] += turned[1]
                else:
                    self._ahead[1, 3] += turned[0]
                    self._ahead[-1, 3] += GRAVITY_M_S2 * turned[1]
            self._now_ns += TICK_NS
            self._ticks += 1
        self._show()

    @property
    def equations(self) -> Equations:
        """The equations as they are now, in steady waves."""
        ahead = np.array([self._state[kernel.MOMENTS], self._state[kernel.SWAY]])
        waves = self._waves.at(self._ticks)
        return Equations(self._row, self._restoring, self._coefficients, ahead, *waves)

    def _tick(self, phasors: ComplexArray, rotations: ComplexArray) -> None:
        if self._lateral is None:
            kernel.advance_tick(
                self._state,
                self._row,
                self._restoring,
                self._linear_model,
                self._coefficients,
                phasors,
                rotations,
                self._weights,
            )
            return
        from firmware_sim import lateral_plant_kernel

        lateral_plant_kernel.advance_tick(
            self._state, self._x, self._ahead, self._row, *self._oscillators, self._per_piece,
            self._restoring, self._coefficients, phasors, rotations, self._weights,
        )  # fmt: skip

    def drive_pump(self, setpoint_pa: float, *, enabled: bool) -> None:
        """Set the pump's command from now on; a pump not `enabled` turns freely."""
        if self._cuts:
            self._state[kernel.MODE] = kernel.FREE
        elif self.broken_pump is not None and (enabled or self.presses_off):
            self.impose_pressure(self.broken_pump(setpoint_pa))
        elif self._has_pump:
            self._state[kernel.SETPOINT] = setpoint_pa
            self._state[kernel.MODE] = kernel.DRIVEN if enabled else kernel.FREE

    @property
    def power_cut(self) -> bool:
        """Whether a wire cuts the drive's power: then nothing presses, whatever the drive does."""
        return bool(self._cuts)

    def cut_power(self, by: str, *, cut: bool) -> None:
        """Cut the drive's power, or end the cut of the one who made it."""
        if cut and self._has_pump:
            self._cuts.add(by)
            self._state[kernel.MODE] = kernel.FREE
        else:
            self._cuts.discard(by)

    def brake_pump(self) -> None:
        """Brake at the motor's limit, without the pressure loop's lag and rate limit."""
        self.drive_pump(0.0, enabled=True)
        self._state[kernel.REFERENCE] = 0.0

    def impose_pressure(self, pressure_pa: float) -> None:
        """Hold the pressure rise of a pump outside the emulation.

        The emulated rotor turns freely meanwhile, and `pump_power_w` is the hydraulic power.
        """
        self._state[kernel.SETPOINT] = pressure_pa
        self._state[kernel.MODE] = kernel.IMPOSED

    def set_valve_loss(self, loss_pa_per_m2_s2: float) -> None:
        """Set the pressure loss per ``|dh/dt| dh/dt`` from now on, see `dynamics.valves`.

        A valve that is as good as tight holds the water.
        """
        tight = loss_pa_per_m2_s2 >= self._locked_loss
        self._state[kernel.VALVE_LOSS] = LOCKED if tight else loss_pa_per_m2_s2

    def _show(self) -> None:
        """Show what every tick reads as plain numbers; elements of an array cost more."""
        values: list[float] = self._state.tolist()
        self._values = values
        roll, roll_rate, level, level_rate, speed, _, _, pressure, _, power = values[
            : kernel.LIMITED
        ]
        self.roll_rad = roll  #: Roll angle, positive to starboard.
        self.roll_rate_rad_s = roll_rate
        self.level_m = level  #: Starboard level above still water; the port level is its negative.
        self.flow_m3_s = level_rate * self._area_m2  #: Flow through the duct to starboard.
        #: Pressure rise across the pump; positive raises the starboard level.
        self.pressure_pa = pressure
        self.pump_speed_rad_s = speed  #: Speed of the pump's rotor.
        self.pump_power_w = power  #: Shaft power; negative when the water drives the motor.

    @property
    def pump_energy_j(self) -> float:
        """Work of the shaft since the start."""
        return self._values[kernel.SHAFT_WORK]

    @property
    def wave_work_j(self) -> float:
        """Work of the waves since the start, in a frame that sways with the ship."""
        return self._values[kernel.WAVE_WORK]

    @property
    def pump_work_j(self) -> float:
        """Work of the pump's pressure on the water since the start."""
        return self._values[kernel.PUMP_WORK]

    @property
    def losses_j(self) -> float:
        """Energy lost in damping of ship and water, valve and strikes since the start."""
        parts = (kernel.DAMPED, kernel.DAMPED_STRIKING, kernel.STRUCK)
        return sum([self._values[part] for part in parts])

    @property
    def strikes(self) -> int:
        """Number of strikes of the water on a limit of its level since the start."""
        return int(self._values[kernel.SUMMED][STRIKES])

    @property
    def max_strike_impulse_nms(self) -> float:
        """Greatest angular impulse of a strike on the ship."""
        return self._values[kernel.SUMMED][MAX_IMPULSE]

    @property
    def capsized_s(self) -> float:
        """Time since the start at which the ship capsized; infinite if it did not."""
        return self._values[kernel.CAPSIZED]

    @property
    def wave_moment_nm(self) -> float:
        """Roll moment of the waves."""
        return self._values[kernel.MOMENT_NOW]

    @property
    def lateral_m_s2(self) -> float:
        """Lateral acceleration of the ship's centre of gravity, positive to starboard."""
        return GRAVITY_M_S2 * self._values[kernel.SWAY_NOW]

    @property
    def heave_m_s2(self) -> float:
        """Downward acceleration of the tank by heave and pitch; 0 if the ship does not."""
        return self._values[kernel.HEAVE_NOW]

    @property
    def pressure_limited(self) -> bool:
        """Whether the set-point is at the pump's pressure limit."""
        return abs(self._values[kernel.SETPOINT]) >= self._pump.max_pressure_pa

    @property
    def rate_limited(self) -> bool:
        """Whether the pump's own rate limit acts on the pressure."""
        behind_pa = abs(self._values[kernel.SETPOINT] - self._values[kernel.REFERENCE])
        return behind_pa > self._pump.max_pressure_rate_pa_s * self._pump.reference_lag_s

    @property
    def speed_limited(self) -> bool:
        """Whether the rotor is at its speed limit, or driven beyond it by the water."""
        return abs(self.pump_speed_rad_s) >= 0.999 * self._pump.max_speed_rad_s

    @property
    def power_limited(self) -> bool:
        """Whether torque or power of the motor is at its limit."""
        return bool(self._values[kernel.LIMITED]) and not self.speed_limited
