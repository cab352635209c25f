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

from tools.thesis.capsize.survival import Survival, controlled_run, largest_survivable_wave
from tools.thesis.capsize.threshold import without_tank
from utank_hil.control.design_plant import PumpLimits
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.direct import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics
from utank_hil.control.interface import Controller
from utank_hil.control.limiter import CommandLimiter
from utank_hil.control.passive import PassiveController
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.simulate import WaveMoment
from utank_hil.dynamics.tank import Tank

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
