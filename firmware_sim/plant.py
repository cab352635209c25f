"""The emulated ship: ship, tank and pump in waves, integrated up to a given time."""

import math

import numpy as np

from firmware_sim import plant_kernel as kernel
from utank_hil.arrays import FloatArray
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.sea import Harmonics
from utank_hil.tick import TICK_NS, TICK_S


def _model(ship: RollShip, tank: Tank) -> FloatArray:
    """Matrices, reservoir area and heeling accelerations in the kernel's layout, shape (4, 7)."""
    system = coupled_model(ship, tank)
    model = np.zeros((4, 7))
    model[:, :4] = system.A
    model[:, 4:6] = system.B
    model[:, 6] = system.B[:, 1] * ship.heeling_moment_nm
    model[0, 6] = tank.reservoir_area_m2
    return model


class Plant:
    """Ship, tank and pump in waves, integrated at 1 kHz.

    The ship is upright and at rest at the first `advance`. Off-centre weight and steady wind heel
    it from then on. The pump follows its set-point through its own pressure loop. Switched off, its
    rotor turns freely in the water.

    Parameters
    ----------
    ship : RollShip
    tank : Tank
    pump : Pump
    wave_moment : Harmonics
        Roll moment of the waves in N m, from the plant's start on.
    """

    def __init__(self, ship: RollShip, tank: Tank, pump: Pump, wave_moment: Harmonics) -> None:
        self._tank = tank
        self._model = self._later_model = _model(ship, tank)
        self._change_ns: int | None = None
        self._area_m2 = tank.reservoir_area_m2
        self._pump = pump
        self._coefficients = tuple(pump.coefficients)
        self._weights = kernel.interpolation_weights()
        frequency, phase = wave_moment.frequency_rad_s, wave_moment.phase_rad
        self._rotations = np.exp(1j * frequency * TICK_S)
        # three ticks before the last of the four moments, which is two ticks ahead of the start
        self._phasors = wave_moment.amplitude * np.exp(1j * (phase - 2.0 * frequency * TICK_S))
        self._state = np.zeros(kernel.STATES)
        for index in range(4):
            moment = kernel.turned_sum(self._phasors, self._rotations)
            self._state[kernel.MOMENTS][index] = moment
        self._values: list[float] = self._state.tolist()
        self._now_ns: int | None = None

    def change_ship(self, ship: RollShip, after_ns: int) -> None:
        """Set the ship's parameters from some time after the start on; the wave moment stays.

        To be called before the first `advance`.
        """
        self._later_model = _model(ship, self._tank)
        self._change_ns = after_ns

    def advance(self, now_ns: int) -> None:
        """Integrate up to `now_ns`, in whole ticks after the first call."""
        if self._now_ns is None:
            self._now_ns = now_ns
            if self._change_ns is not None:
                self._change_ns += now_ns
        if now_ns - self._now_ns < TICK_NS:
            return
        while now_ns - self._now_ns >= TICK_NS:
            if self._change_ns is not None and self._now_ns >= self._change_ns:
                self._model, self._change_ns = self._later_model, None
            kernel.advance_tick(
                self._state,
                self._model,
                self._coefficients,
                self._phasors,
                self._rotations,
                self._weights,
            )
            self._now_ns += TICK_NS
        # as plain numbers: reading an array's elements one by one costs more than all of them
        self._values = self._state.tolist()

    def drive_pump(self, setpoint_pa: float, *, enabled: bool) -> None:
        """Set the pump's command from now on.

        Parameters
        ----------
        setpoint_pa : float
            Commanded pressure.
        enabled : bool
            Whether the motor is on; if not, the rotor turns freely.
        """
        self._state[kernel.SETPOINT] = setpoint_pa
        self._state[kernel.MODE] = kernel.DRIVEN if enabled else kernel.FREE

    def brake_pump(self) -> None:
        """Brake as fast as the motor can, without the pressure loop's lag and rate limit."""
        self.drive_pump(0.0, enabled=True)
        self._state[kernel.REFERENCE] = 0.0

    def impose_pressure(self, pressure_pa: float) -> None:
        """Hold the pressure rise of a pump outside the emulation.

        The emulated rotor turns freely meanwhile, and `pump_power_w` is the hydraulic power.
        """
        self._state[kernel.SETPOINT] = pressure_pa
        self._state[kernel.MODE] = kernel.IMPOSED

    @property
    def roll_rad(self) -> float:
        """Roll angle, positive to starboard."""
        return self._values[kernel.ROLL]

    @property
    def roll_rate_rad_s(self) -> float:
        """Roll rate."""
        return self._values[kernel.ROLL_RATE]

    @property
    def level_m(self) -> float:
        """Starboard level above still water; the port level is its negative."""
        return self._values[kernel.LEVEL]

    @property
    def flow_m3_s(self) -> float:
        """Flow through the duct to starboard."""
        return self._values[kernel.LEVEL_RATE] * self._area_m2

    @property
    def pressure_pa(self) -> float:
        """Pressure rise across the pump; positive raises the starboard level."""
        return self._values[kernel.PRESSURE]

    @property
    def pump_speed_rad_s(self) -> float:
        """Speed of the pump's rotor."""
        return self._values[kernel.SPEED]

    @property
    def pump_power_w(self) -> float:
        """Shaft power; negative when the water drives the motor."""
        return self._values[kernel.POWER]

    @property
    def pump_energy_j(self) -> float:
        """Work of the shaft since the start."""
        return self._values[kernel.ENERGY]

    @property
    def wave_moment_nm(self) -> float:
        """Roll moment of the waves."""
        return self._values[kernel.MOMENT_NOW]

    @property
    def pressure_limited(self) -> bool:
        """Whether the set-point is at the pump's pressure limit."""
        return abs(self._values[kernel.SETPOINT]) >= self._pump.max_pressure_pa

    @property
    def rate_limited(self) -> bool:
        """Whether the pump's own rate limit holds the pressure back."""
        behind_pa = abs(self._values[kernel.SETPOINT] - self._values[kernel.REFERENCE])
        return behind_pa > self._pump.max_pressure_rate_pa_s * self._pump.reference_lag_s

    @property
    def speed_limited(self) -> bool:
        """Whether the rotor turns as fast as it may."""
        return math.isclose(abs(self.pump_speed_rad_s), self._pump.max_speed_rad_s, rel_tol=1e-3)

    @property
    def power_limited(self) -> bool:
        """Whether torque or power of the motor is at its limit."""
        return bool(self._values[kernel.LIMITED]) and not self.speed_limited
