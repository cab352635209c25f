"""What each step of a retuning costs the controller, and the retuner's whole work.

    python -m tools.benchmarks.retuning [--json]

In a plain loop on a linear ship with the law of the adaptive scenario (roll alone, ARX order 200,
500 s of pulses), with the retuner's process at work beside it. What that process does to the loop's
lateness says `tools.benchmarks.realtime`.
"""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from firmware_sim.scenario import Scenario
from tools.printing import command_line, show
from utank_hil.assembly import retuner_work
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningOrder, RetuningState
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import PredictiveDesign
from utank_hil.dynamics import coupled_model
from utank_hil.dynamics.sampling import sample
from utank_hil.retuning import AdaptiveController, RetunerProcess, ShipFigures, make_pulses

SCENARIO = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "adaptive.yaml"
CONTROLLER = "gpc-roll"
SECOND_NS = 1_000_000_000
PERIOD_S = 7.5  # of the ship that the costs are measured with
WAVE_NM, WAVE_RAD_S = 2e7, 0.6
BEGUN, REPEATS = 200, 5


def costs(config: ControllerConfig, repeats: int) -> dict[str, float]:
    """Median times in us of the adaptive controller's steps, and of the retuner's whole work."""
    times: dict[str, list[float]] = {}
    for _ in range(repeats):
        retune_once(config, times)
    return {name: 1e6 * float(np.median(values)) for name, values in times.items()}


def retune_once(config: ControllerConfig, times: dict[str, list[float]]) -> None:
    """Retune on order, and add the time of each step under its name."""
    design, settings, plant = config.law, config.retuning, config.plant
    work = retuner_work(config)
    assert isinstance(design, PredictiveDesign)
    assert settings is not None
    assert work is not None
    period_s = design.predictor.sample_time_s
    with RetunerProcess(work) as process:
        (retuner,) = process.desks
        law = design.law(plant)
        controller = AdaptiveController(
            law,
            law.controller(),
            ShipFigures(
                plant.ship.stiffness_nm_rad, plant.ship.inertia_kg_m2, plant.ship.damping_nms_rad
            ),
            design.predictor.measured.index("roll_rad"),
            settings,
            make_pulses(settings, plant, period_s),
            retuner,
        )
        ship = _Rolling(config)
        handed_over = 0.0
        for k in range(round((settings.identification_s + 2 * settings.trial_s) / period_s)):
            before, candidate = controller.state, controller.candidate
            if before is RetuningState.DESIGN and candidate is None:
                time.sleep(period_s)  # the other process works in true time
            pressed = RetuningOrder(retune=k == BEGUN)
            start = time.perf_counter()
            controller.update(round(k * period_s * SECOND_NS), pressed, engaged=True, fresh=True)
            middle = time.perf_counter()
            answer = controller.step(ship.outputs)
            end = time.perf_counter()
            now = controller.state
            if before is RetuningState.IDENTIFY and now is RetuningState.DESIGN:
                handed_over = end
                times.setdefault("handing the record over", []).append(middle - start)
            elif controller.candidate is not candidate:
                times.setdefault("identification and design", []).append(end - handed_over)
                times.setdefault("taking the law in", []).append(middle - start)
            elif now is RetuningState.DESIGN and candidate is None:
                times.setdefault("looking for the law", []).append(middle - start)
            elif now is RetuningState.DESIGN:
                times.setdefault("step, filling the law's memory", []).append(end - middle)
            else:
                times.setdefault(f"step, {now.name}", []).append(end - middle)
                times.setdefault(f"update, {now.name}", []).append(middle - start)
            controller.applied(ship.push(answer))
    assert controller.state is RetuningState.RETUNED, controller.events


class _Rolling:
    """A linear ship of another loading in a regular wave."""

    def __init__(self, config: ControllerConfig) -> None:
        design, plant = config.law, config.plant
        assert isinstance(design, PredictiveDesign)
        stiffness = plant.ship.inertia_kg_m2 * (2 * math.pi / PERIOD_S) ** 2
        ship = replace(plant.ship, stiffness_nm_rad=stiffness)
        self._period_s = design.predictor.sample_time_s
        names = list(design.predictor.measured)
        model = coupled_model(ship, plant.tank)
        both = model[names, ["pressure_pa", "wave_moment_nm"]]
        self._plant = sample(both, self._period_s, plant.delay_s, plant.lag_s)
        self._noise = np.random.default_rng(1)
        self._deviation = np.array(design.predictor.measurement_std) / 10
        self._limit_pa = plant.limits.pressure_pa
        self._state = np.zeros(len(self._plant.A))
        self._steps = 0
        self.outputs = np.zeros(len(names))

    def push(self, pressure_pa: FloatArray) -> FloatArray:
        """Let a sample time pass; what of the pressure was within the pump's limit."""
        applied = np.clip(pressure_pa, -self._limit_pa, self._limit_pa)
        wave_nm = WAVE_NM * math.cos(WAVE_RAD_S * self._period_s * self._steps)
        self._steps += 1
        inputs = np.array([float(applied[0]), wave_nm])
        noise = self._deviation * self._noise.standard_normal(len(self.outputs))
        self.outputs = self._plant.C @ self._state + self._plant.D @ inputs + noise
        self._state = self._plant.A @ self._state + self._plant.B @ inputs
        return applied


def main() -> None:
    """Measure and print."""
    arguments = command_line(__doc__).parse_args()
    scenario = load_config(SCENARIO, Scenario)
    show({"costs_us": costs(scenario.controllers[CONTROLLER], REPEATS)}, arguments)


if __name__ == "__main__":
    main()
