"""Comparison of thesis section 4.5: Patti-B without tank, passive, and with each nonlinear law.

The source gives neither Lz nor the tank's friction, the pump's limits or the laws' parameters; the
values here are our own. The high-gain fuzzy parameters need a pump without limits, because
saturation makes these laws unstable (docs/control.md). A limited pump gets lower gains.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tools.thesis.batch import simulate_batch
from tools.thesis.simulate import WaveMoment, whole_steps
from utank_hil.base.arrays import FloatArray
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics
from utank_hil.control.gain import PassiveController
from utank_hil.control.interface import Controller, PumpLimits
from utank_hil.control.limiter import CommandLimiter
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank, negligible

LIMIT_RAD = math.radians(89)  # of the search for equilibria
BLOCK = 256  # amplitudes tried at once in the search for a threshold


class Equilibrium(NamedTuple):
    """An equilibrium of ship and water."""

    roll_rad: float
    level_m: float
    stable: bool  #: True for a minimum of the potential energy; otherwise a saddle.


class Threshold(NamedTuple):
    """Bracket of the smallest amplitude of a regular wave moment that capsizes a ship."""

    #: safe_nm, capsizing_nm: ends of the bracket; the upper one is infinite if no amplitude
    #: capsizes the ship.
    safe_nm: float
    capsizing_nm: float


def without_tank(model: RollModel) -> RollModel:
    """The same ship with a negligible tank: 1e-9 of the water, strongly damped."""
    return RollModel(model.ship, negligible(model.tank))


def equilibria(model: RollModel) -> tuple[Equilibrium, ...]:
    """Equilibria without pressure and waves, up to 89 degrees, from port to starboard.

    The level may be at its limit.
    """
    from scipy.optimize import brentq

    half, limit = model.tank.width_m / 2, model.coefficients.level_limit

    def level(roll: float) -> float:  # the water lies flat, tan(roll) half, as far as it can
        return float(np.clip(math.tan(roll) * half, -limit, limit))

    def moment(roll: float) -> float:
        state = np.array([roll, 0.0, level(roll), 0.0])
        return float(model.derivative(state, stopped=True)[1])

    grid = np.linspace(-LIMIT_RAD, LIMIT_RAD, 2001)
    values = np.array([moment(roll) for roll in grid])
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        roll = brentq(moment, grid[i], grid[i + 1], xtol=1e-14)
        found.append(Equilibrium(roll, level(roll), bool(values[i] > 0)))
    found += [
        Equilibrium(float(grid[i]), level(grid[i]), bool(values[i - 1] > values[i + 1]))
        for i in np.flatnonzero(values == 0)
    ]
    return tuple(sorted(found))


def capsize_threshold(
    model: RollModel,
    frequency_rad_s: float,
    highest_nm: float,
    *,
    duration_s: float = 300.0,
    phase_rad: float = 0.0,
    cells: int = 4000,
    tolerance: float = 1e-3,
) -> Threshold:
    """Smallest amplitude of a regular wave moment that capsizes a ship initially at rest.

    The safe amplitudes need not form one interval: their boundary is fractal beyond a certain
    forcing, and windows in which it capsizes lie far below the amplitudes that always capsize
    it. So the whole range is searched upwards in steps of 1 / `cells` of it, and finer steps
    refine the first capsize. A window narrower than a step may be missed.

    Parameters
    ----------
    highest_nm : float
        Largest amplitude of the scan.
    phase_rad : float
        Phase in ``amplitude cos(frequency t + phase)``.
    cells : int
        Steps of the search up to `highest_nm`.
    tolerance : float
        Relative width of the bracket.
    """

    def first_capsize(amplitude: FloatArray) -> Threshold | None:
        """The first of rising amplitudes that capsizes it, and the one before."""
        wave = WaveMoment(amplitude[1:, None], [[frequency_rad_s]], [[phase_rad]])
        result = simulate_batch(model, duration_s, wave=wave)
        over = np.flatnonzero(np.isfinite(result.capsized_s))
        return Threshold(*amplitude[over[0] : over[0] + 2].tolist()) if over.size else None

    steps = np.linspace(0, highest_nm, cells + 1)
    blocks = (steps[start : start + BLOCK + 1] for start in range(0, cells, BLOCK))
    found = next(filter(None, map(first_capsize, blocks)), None)
    if found is None:
        return Threshold(highest_nm, math.inf)
    while found.capsizing_nm - found.safe_nm > tolerance * found.capsizing_nm:
        found = first_capsize(np.linspace(found.safe_nm, found.capsizing_nm, BLOCK + 1)) or found
    return found


def safe_basin(
    model: RollModel,
    roll_rad: FloatArray,
    roll_rate_rad_s: FloatArray,
    duration_s: float,
) -> npt.NDArray[np.bool_]:
    """Starts that survive in calm water, with the tank's flat and at rest relative to the ship.

    The result has shape (b, a) for rolls of shape (a,) and rates of shape (b,).
    """
    limit = model.coefficients.level_limit
    roll, rate = np.meshgrid(roll_rad, roll_rate_rad_s)
    level = np.clip(np.tan(roll) * model.tank.width_m / 2, -limit, limit)
    initial = np.stack([roll, rate, level, np.zeros_like(roll)], axis=-1).reshape(-1, 4)
    result = simulate_batch(model, duration_s, initial)
    return np.asarray(np.isinf(result.capsized_s).reshape(roll.shape))


class Survival(NamedTuple):
    """Result of a run."""

    capsized_s: float  #: Time of capsizing, infinite if the ship survives.
    #: max_roll_rad, max_level_m: maxima at the controller's samples.
    max_roll_rad: float
    max_level_m: float
    max_command: float  #: Largest pressure in Pa, or largest valve loss in Pa / (m/s)^2.
    strikes: int  #: Number of impacts at the limits of the level.


def controlled_run(
    model: RollModel,
    controller: Controller,
    wave: WaveMoment,
    duration_s: float,
    *,
    limiter: CommandLimiter | None = None,
    initial: FloatArray | None = None,
    valve: bool = False,
    step_s: float = 0.02,
    capsize_rad: float = math.pi / 2,
    each_step: Callable[[float, FloatArray, float], None] | None = None,
) -> Survival:
    """Run a controller on the nonlinear model.

    Raises `ValueError` if the duration is not a whole number of samples, or the sample time of
    steps.

    The controller sees roll, roll rate, level and level rate. Its command is a pressure, or with
    `valve` a valve's loss. A `limiter` has the controller's sample time as its period; without one
    the pump has no limits. The run begins upright and at rest unless `initial`, shape (4,), is
    given, and ends at `capsize_rad`. `each_step` takes time, state and command at every sample.
    """
    from tools.thesis.simulate_kernel import advance
    from utank_hil.dynamics import kernels

    hold = whole_steps("sample time", controller.sample_time_s, step_s)
    samples = whole_steps("duration_s", duration_s, controller.sample_time_s)
    state = np.zeros(4) if initial is None else np.array(initial, dtype=np.float64)
    packed = model.packed
    amplitude, frequency, phase = (np.ascontiguousarray(x, dtype=np.float64) for x in wave)
    summary = np.zeros(kernels.SUMMARY)
    summary[kernels.CAPSIZED_S] = np.inf
    inputs = np.zeros((2, 1))  # pressure, valve loss
    nowhere = np.empty((0, 4))
    impacts = np.empty((0, 5))
    max_command = 0.0
    for k in range(samples):
        command = float(controller.step(state.copy())[0])
        if limiter is not None:
            command = limiter.limit(command, float(state[2]), float(state[3]))
        inputs[int(valve), 0] = command
        controller.applied(inputs[int(valve)].copy())
        max_command = max(max_command, abs(command))
        if each_step is not None:
            each_step(k * controller.sample_time_s, state, command)
        advance(
            *packed, amplitude, frequency, phase, inputs[0], inputs[1], hold,
            capsize_rad, k * hold, hold, step_s, state, summary, impacts, nowhere, hold,
        )  # fmt: skip
        if math.isfinite(summary[kernels.CAPSIZED_S]):
            break
    return Survival(
        float(summary[kernels.CAPSIZED_S]),
        float(summary[kernels.MAX_ROLL]),
        float(summary[kernels.MAX_LEVEL]),
        max_command,
        int(summary[kernels.STRIKES]),
    )


def largest_survivable_wave(
    survives: Callable[[float], bool], highest_nm: float, tolerance: float = 0.01
) -> float:
    """Largest survived amplitude of the wave moment, by bisection.

    The survived amplitudes need not form one interval; bisection finds one of its ends.

    `survives` takes an amplitude in N m; `tolerance` is the relative width of the final bracket.
    The result is infinite if `highest_nm` is survived.
    """
    if survives(highest_nm):
        return math.inf
    low, high = 0.0, highest_nm
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low


PATTI_B = RollModel(
    RollShip(1.468e6, 2.366e6 * 0.2138, 3.206e3, 9.882e4, restoring_odd_nm=(-2.366e6 * 0.6713,)),
    Tank(5.0, 2.0, 2.0, 0.19, damping_ratio=0.10),
)
WAVE_RAD_S = 0.6
PRINTED_NM = (5.0860e4, 7.8601e4, 8.6461e4, 1.7292e5)
SAMPLE_S = 0.02
LEVEL_M = 1.9
LAWS = (
    "no tank",
    "passive",
    "feedback linearization (4.11)",
    "feedback linearization, level braked",
    "fuzzy (4.20)",
    "fuzzy (4.23)",
    "fuzzy (4.25)",
)


class Contest(NamedTuple):
    """Result of one law with one pump."""

    runs: tuple[Survival, ...]  #: Runs at the amplitudes `PRINTED_NM`.
    survivable_nm: float  #: Largest survived wave moment.


def contest(law: str, pump_pa: float = math.inf, duration_s: float = 300.0) -> Contest:
    """Run one law in the printed waves, and find the largest wave that it survives.

    Raises `ValueError` if there is no such law.

    `pump_pa` is the largest pressure. The rate limit is ten times that per second, and the level
    barrier of `CommandLimiter` keeps the water within `LEVEL_M`, also with the passive law.
    Infinite: a pump without limits, and a passive tank without a pump.
    """
    model = without_tank(PATTI_B) if law == "no tank" else PATTI_B
    build = law_factory(law, unlimited=math.isinf(pump_pa))
    pumped = math.isfinite(pump_pa) and law != "no tank"

    def run(amplitude_nm: float) -> Survival:
        limiter = None
        if pumped:
            limits = PumpLimits(pressure_pa=pump_pa, rate_pa_s=10 * pump_pa, level_m=LEVEL_M)
            limiter = CommandLimiter(limits, model.tank, SAMPLE_S)
        wave = WaveMoment([amplitude_nm], [WAVE_RAD_S], [0.0])
        return controlled_run(model, build(), wave, duration_s, limiter=limiter)

    largest = largest_survivable_wave(lambda nm: math.isinf(run(nm).capsized_s), 4e5)
    return Contest(tuple(run(amplitude) for amplitude in PRINTED_NM), largest)


def law_factory(law: str, *, unlimited: bool) -> Callable[[], Controller]:
    """Factory of new controllers of one of `LAWS`, at rest; `ValueError` if it is none.

    The fuzzy laws have other parameters for a pump that is `unlimited`.
    """
    c = PATTI_B.coefficients
    gain = -c.coupling * c.area / (c.inertia * c.level_inertia - c.coupling**2)
    brake, stiffness = level_brake(PATTI_B, 0.5), PATTI_B.ship.stiffness_nm_rad
    ranges = (np.pi / 6, np.pi / 6, 1.0, 1.0)  # (4.26)
    slow, fast = ErrorDynamics(0.59, 0.5, 2.5), ErrorDynamics(1.5, 0.7, 2.5)
    linearization = partial(
        FeedbackLinearization,
        ship=PATTI_B.ship,
        tank=PATTI_B.tank,
        frequency_rad_s=0.59,
        sample_time_s=SAMPLE_S,
    )
    if law in ("no tank", "passive"):
        return lambda: PassiveController(sample_time_s=SAMPLE_S)
    if law == "feedback linearization (4.11)":  # without level brake, as printed
        return linearization(damping_ratio=1.0, soft_level_m=1e3, hard_level_m=2e3).controller
    if law == "feedback linearization, level braked":
        return linearization(
            damping_ratio=0.5, soft_level_m=1.7, hard_level_m=1.98, level_damping_ratio=0.4
        ).controller
    if law == "fuzzy (4.20)":
        return SmallGainFuzzy(
            error=slow if unlimited else fast,
            ranges=ranges,
            gain_rad_s2_pa=gain,
            gamma=0.9,
            rho=1.0,
            adaptation=0.02 if unlimited else 0.1,
            leakage=1.0 if unlimited else 20.0,
            initial=0.15 if unlimited else 0.0,
            brake_pa_s_m=brake if unlimited else 0.0,
            sample_time_s=SAMPLE_S,
        ).controller
    if law == "fuzzy (4.23)":
        return RobustFuzzy(
            error=slow if unlimited else fast,
            ranges=ranges,
            gain_rad_s2_pa=gain,
            gamma=0.9,
            epsilon=1.0 if unlimited else 0.1,
            adaptation=(0.02, 0.02) if unlimited else (0.1, 0.1),
            leakage=(1.0, 1.0) if unlimited else (200.0, 200.0),
            initial=(0.15, 0.05) if unlimited else (0.0, 0.0),
            brake_pa_s_m=brake if unlimited else 0.0,
            sample_time_s=SAMPLE_S,
        ).controller
    if law == "fuzzy (4.25)":
        return IndirectFuzzy(
            error=slow,
            ranges=ranges,
            gain_rad_s2_pa=gain,
            adaptation_f=0.02,
            adaptation_g=0.02,
            leakage=0.02,
            # prior knowledge: the ship's stiffness and the weight of the water
            prior=(0.0, -stiffness / c.inertia, 0.0, c.weight_h / c.inertia, 0.0),
            brake_pa_s_m=brake,
            sample_time_s=SAMPLE_S,
        ).controller
    raise ValueError(f"no law {law!r}; there are {', '.join(LAWS)}")
