"""Prediction of a scenario: the bench's ship, sea, pump and laws, without bus and nodes.

The plant is that of the bench, with all its limits and losses; sensors' noise, level observer,
limiter and delay are those of `loop_simulation`. What the nodes add (steps of the frames, monitors,
the time until the pump is armed) is left out, and most of a bench's time with it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from firmware_sim.plant import Plant
from firmware_sim.run import RECORD_S, roll_at_zero_pressure, roll_without_tank
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import plant_of
from utank_hil.analysis.loop.loop_simulation import SensorNoise, run_law, sensed_noise
from utank_hil.analysis.loop.loop_ticks import Signals
from utank_hil.analysis.loop.margins import PERIOD_SCALES, of_period
from utank_hil.analysis.motion.statistics import (
    Interval,
    PumpStatistics,
    batch_means,
    mean_interval,
    pump_statistics,
    rms_batches,
)
from utank_hil.assembly import build_law, retuner_work
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Verdict
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw, DesignPlant
from utank_hil.nodes.signals import ROW_TICKS
from utank_hil.retuning import MotionEstimate, RenewedLaw, ShipFigures
from utank_hil.sea import SlopeSpectrum

SEEDS: Final = (1001, 1002, 1003, 1004)  #: Draws of the sea; a scenario's own is rarely one.
ROLLS: Final = 60  #: Rolls of the ship in each draw.
BATCHES: Final = 3
"""Batches of a draw: of 20 rolls, the least for which `compare` gives an interval."""
_BANDS: Final = 400  #: Of the waves that a law is renewed for.

Laws = tuple[BuiltLaw | None, ...]
"""The law of a bench, or the first one and the renewed one; None where there is none."""


@dataclass(frozen=True, slots=True)
class Expected:
    """What a bench of the scenario is expected to give.

    Each `Interval` holds 95 % of the benches of the scenario's length, over the draws of the sea;
    roll is RMS. Where the ship capsizes in a draw there is None, and so without a law that moves a
    pump.
    """

    window_s: float  #: Of the scenario's statistics.
    without_tank_rad: Interval | None
    passive_rad: Interval | None
    active_rad: Interval | None = None
    passive_below_no_tank: Interval | None = None
    active_below_passive: Interval | None = None
    mean_power_w: Interval | None = None  #: Of the shaft; what flows back counts as zero.
    pump: PumpStatistics | None = None  #: Over all draws, so its peaks are those of a longer run.
    flow_peak_m3_s: float | None = None  #: Through the pump, likewise.
    roll_peak_rad: float | None = None  #: With the law, likewise.

    def as_json(self) -> dict[str, Any]:
        """Figures in SI units; an interval has its mean and half width."""
        return {
            name: value._asdict() if isinstance(value, Interval) else value
            for name, value in asdict(self).items()
        }


class Peaks(NamedTuple):
    """What is asked of a pump and its tank at most."""

    pressure_pa: float
    level_m: float
    flow_m3_s: float
    power_w: float


def peaks(found: Sequence[Expected]) -> Peaks | None:
    """Peaks over all laws; None without one that moves a pump."""
    each = [
        (of.pump.pressure_peak_pa, of.pump.level_peak_m, of.flow_peak_m3_s, of.pump.power_peak_w)
        for of in found
        if of.pump is not None and of.flow_peak_m3_s is not None
    ]
    return Peaks(*map(max, zip(*each, strict=True))) if each else None


def as_json(found: Sequence[Expected]) -> dict[str, Any]:
    """Figures of `predict` for JSON: the first law's, ``renewed`` ones, and peaks over both."""
    first, *renewed = [each.as_json() for each in found]
    most = peaks(found)
    return first | {
        "renewed": renewed[0] if renewed else None,
        "peaks": None if most is None else most._asdict(),
    }


@dataclass(frozen=True, slots=True)
class Loading:
    """What is expected in another loading, with unchanged tank and law."""

    period_scale: float  #: Factor on the roll period, by the stiffness.
    expected: Expected


class PlantInLoop:
    """A plant as `run_ticks` moves it, with noise for its sensors, shape (n, 5)."""

    def __init__(self, plant: Plant, area_m2: float, noise: FloatArray) -> None:
        self._plant, self._area_m2, self._noise = plant, area_m2, iter(noise.tolist())
        self._now_ns = 0
        self.power_w: list[float] = []  #: Shaft power at the ticks that are kept.
        plant.advance(0)

    def sensed(self) -> Signals:
        """Signals of this tick with the sensors' noise."""
        roll, roll_rate, level, level_rate, pressure = self._signals()
        of_roll, of_roll_rate, of_level, _, of_pressure = next(self._noise)
        return (
            roll + of_roll, roll_rate + of_roll_rate, level + of_level, level_rate,
            pressure + of_pressure,
        )  # fmt: skip

    def _signals(self) -> Signals:
        plant = self._plant
        rate_m_s = plant.flow_m3_s / self._area_m2
        return plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, rate_m_s, plant.pressure_pa

    def truth(self) -> Signals:
        """Signals of this tick."""
        self.power_w.append(self._plant.pump_power_w)
        return self._signals()

    def advance(self, command_pa: float) -> None:
        """Move by one tick with the drive following this pressure."""
        self._plant.drive_pump(command_pa, enabled=True)
        self._now_ns += TICK_NS
        self._plant.advance(self._now_ns)


def laws_of(scenario: Scenario, config: ControllerConfig) -> Laws:
    """Design the law of a controller; where it is renewed, the renewed one of the scenario, too.

    That is what the renewal designs for the configured ship, identified, in the scenario's waves,
    known exactly. Raises `ParameterError` as `build_law`.
    """
    first = build_law(config)
    if not config.renews:
        return (first,)
    from utank_hil.identification.motion_fit import BAND, TOP_RAD_S  # here: scipy.optimize
    from utank_hil.retuning.renewal import PERIOD_DEVIATION, STIFFNESS_DEVIATION

    ship, waves = config.vessel.ship, scenario.pooled_wave_moment()
    low, high = (end * ship.natural_frequency_rad_s for end in BAND)
    edges = np.linspace(low, max(high, TOP_RAD_S), _BANDS + 1)
    slope = np.square(waves.amplitude / ship.stiffness_nm_rad) / 2
    density = np.histogram(waves.frequency_rad_s, edges, weights=slope)[0] / np.diff(edges)
    found = ShipFigures(
        ship.stiffness_nm_rad,
        ship.inertia_kg_m2,
        ship.damping_nms_rad,
        STIFFNESS_DEVIATION,
        PERIOD_DEVIATION,
    )
    spectrum = SlopeSpectrum((edges[1:] + edges[:-1]) / 2, density)
    work = retuner_work(config)
    assert work is not None
    answer = work.compute(MotionEstimate(Verdict.GOOD, Verdict.GOOD, found, spectrum))
    if not isinstance(answer, RenewedLaw):
        return first, None
    return first, BuiltLaw(answer.law.controller, first.measured, answer.law)


def predict(
    scenario: Scenario,
    plant: DesignPlant,
    *laws: BuiltLaw | None,
    seeds: tuple[int, ...] = SEEDS,
) -> tuple[Expected, ...]:
    """Predict a bench by each law: without tank, with it passive and, with a pump's law, active.

    `plant` gives limits and delay of the laws, `seeds` draw the sea.
    """
    period_s = 2 * math.pi / scenario.ship_at(0.0).natural_frequency_rad_s
    settle = round(scenario.settle_s / RECORD_S)
    count = settle + round(ROLLS * period_s / RECORD_S)
    window_s = scenario.duration_s - scenario.settle_s
    widened = math.sqrt(1 + ROLLS * len(seeds) * period_s / window_s)

    def rms(rolled: Callable[[int], tuple[FloatArray, float]]) -> FloatArray | None:
        """Batches of the roll's RMS in all draws; None where the ship capsizes."""
        draws = [rolled(seed) for seed in seeds]
        if any(math.isfinite(capsized_s) for _, capsized_s in draws):
            return None
        rolls = np.concatenate([roll[settle:] for roll, _ in draws])
        return rms_batches(rolls, BATCHES * len(seeds))

    def of_a_bench(values: FloatArray | None) -> Interval | None:
        """Interval of a bench's figure: that of the mean, widened to one window."""
        if values is None:
            return None
        mean, half_width = mean_interval(values)
        return Interval(mean, half_width * widened)

    def below(roll: FloatArray | None, reference: FloatArray | None) -> Interval | None:
        if roll is None or reference is None:
            return None
        of_roll, of_reference = float(roll.mean()), float(reference.mean())
        ratio = of_roll / of_reference
        # linear about the means, as the values of `rms_batches` are
        change = roll / of_roll - reference / of_reference
        return of_a_bench(1 - ratio * (1 + change))

    bare = rms(lambda seed: roll_without_tank(scenario, seed, count))
    passive = rms(lambda seed: roll_at_zero_pressure(plant_of(scenario, seed), count))
    found = Expected(
        window_s, of_a_bench(bare), of_a_bench(passive), passive_below_no_tank=below(passive, bare)
    )

    def by(law: BuiltLaw | None) -> Expected:
        if law is None:
            return found
        runs = {seed: active_run(scenario, plant, law, seed, count) for seed in seeds}
        active = rms(lambda seed: (runs[seed][0]["roll_rad"], runs[seed][1].capsized_s))
        if active is None:
            return found
        roll, level, flow, pressure, power = (
            np.concatenate([record[name][settle:] for record, _ in runs.values()])
            for name in ("roll_rad", "level_m", "flow_m3_s", "pressure_pa", "power_w")
        )
        return replace(
            found,
            active_rad=of_a_bench(active),
            active_below_passive=below(active, passive),
            mean_power_w=of_a_bench(batch_means(np.maximum(power, 0.0), BATCHES * len(seeds))),
            pump=pump_statistics(pressure, power, level),
            flow_peak_m3_s=float(np.abs(flow).max()),
            roll_peak_rad=float(np.abs(roll).max()),
        )

    return tuple(map(by, laws))


def other_loadings(
    scenario: Scenario, plant: DesignPlant, law: BuiltLaw | None, own: Expected
) -> tuple[Loading, ...]:
    """Predict the scenario at the other roll periods `PERIOD_SCALES` of the ship.

    Tank, law and waves are unchanged; `own` is the prediction at the scenario's loading. A hull's
    data are of one loading, so with them there is no other.
    """
    if scenario.hull is not None or scenario.fmu is not None:
        return ()
    return tuple(
        Loading(scale, own if scale == 1 else predict(loaded(scenario, scale), plant, law)[0])
        for scale in PERIOD_SCALES
    )


def loaded(scenario: Scenario, scale: float) -> Scenario:
    """Scenario with its ship loaded to a multiple of its roll period, by its stiffness."""
    ship = of_period(scenario.vessel.ship, scale)
    vessel = scenario.vessel.model_copy(update={"ship": ship})
    actual = dict(scenario.actual_ship)
    if "stiffness_nm_rad" in actual:
        actual["stiffness_nm_rad"] /= scale * scale
    return scenario.model_copy(update={"vessel": vessel, "actual_ship": actual})


def active_run(
    scenario: Scenario, plant: DesignPlant, law: BuiltLaw, seed: int, count: int
) -> tuple[dict[str, FloatArray], Plant]:
    """Run with the law armed from the start; return records every `RECORD_S`, and the ship."""
    controller, ticks = law.controller(), count * ROW_TICKS
    noise, _ = sensed_noise(noise_of(scenario), ticks, seed, controller.sample_time_s)
    ship, area_m2 = plant_of(scenario, seed), plant.tank.reservoir_area_m2
    loop = PlantInLoop(ship, area_m2, noise)
    run = run_law(loop, plant, controller, law.measured, ticks, ROW_TICKS)
    roll, _, level, rate = run.motion.T
    record = {"roll_rad": roll, "level_m": level, "flow_m3_s": area_m2 * rate}
    record |= {"pressure_pa": run.pressure_pa, "power_w": np.array(loop.power_w)}
    return record, ship


def noise_of(scenario: Scenario) -> SensorNoise:
    """Noise of the scenario's sensors; that of the level is of the two gauges' mean."""
    errors = scenario.sensors
    return SensorNoise(
        errors.roll_noise_rad,
        errors.roll_rate_noise_rad_s,
        errors.level_noise_m / math.sqrt(2.0),
        errors.pressure_noise_pa,
    )
