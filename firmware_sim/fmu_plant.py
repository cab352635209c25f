"""Ship and tank of an FMU with the bench's pump, stepped every tick."""

import errno
import math
import shutil
import tempfile
import weakref
from collections import deque
from pathlib import Path
from typing import Any

from firmware_sim import plant_kernel as kernel
from firmware_sim.fmu_file import INPUTS, FmuFile, read_description, scale_of, unpack
from firmware_sim.plant import Plant
from firmware_sim.waves import Waves
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.dynamics.jit import njit
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import PumpCoefficients
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.runners.node import ModelError


class RunningFmu:
    """An FMU unpacked into a folder of its own, which is removed with this object."""

    def __init__(self, section: FmuFile) -> None:
        from fmpy.simulation import instantiate_fmu

        self._section, self._description = section, read_description(section.file)
        self._steps, self._said = 0, deque[tuple[Any, ...]](maxlen=1)
        heard = self._said.append  # A method of this object would keep it from its end.
        folder = tempfile.mkdtemp(prefix="utank-hil-fmu-")
        try:
            unpack(section.file, Path(folder))
            self._fmu = instantiate_fmu(
                folder, self._description, "CoSimulation", logger=lambda *told: heard(told)
            )
        except Exception as error:  # FMPy raises plain exceptions.
            shutil.rmtree(folder)
            raise self._error("loading", f"{error}: is it made for this system?") from error
        weakref.finalize(self, _end, self._fmu, folder)
        second = self._description.fmiVersion == "2.0"
        self._set = self._fmu.setReal if second else self._fmu.setFloat64
        self._get = self._fmu.getReal if second else self._fmu.getFloat64
        known = {each.name: each for each in self._description.modelVariables}
        ours = {
            name: (
                known[each.name].valueReference,
                scale_of(each, self._description, known[each.name]),
            )
            for name, each in section.variables.given()
        }
        self._inputs = {name: each for name, each in ours.items() if name in INPUTS}
        self._outputs = {name: each for name, each in ours.items() if name not in INPUTS}
        self._read_references = [reference for reference, _ in self._outputs.values()]
        given = {known[name].valueReference: x for name, x in section.parameters.items()}
        if given:
            self._call("its parameters", self._set, list(given), list(given.values()))
        if second:
            self._call("its setup", self._fmu.setupExperiment)
        self._call("its initialisation", self._fmu.enterInitializationMode)
        self._call("its initialisation", self._fmu.exitInitializationMode)

    def outputs(self) -> dict[str, float]:
        """Return the outputs in the units of the bench; ModelError if one is not finite."""
        values = self._call("reading", self._get, self._read_references)
        found = {
            name: value * scale
            for (name, (_, scale)), value in zip(self._outputs.items(), values, strict=True)
        }
        for name, value in found.items():
            if not math.isfinite(value):
                raise self._error("reading", f"{name} is {value}: check parameters and inputs")
        return found

    def step(self, inputs: dict[str, float]) -> None:
        """Advance by a tick with inputs held, those in the table of variables."""
        references, values = [], []
        for name, (reference, scale) in self._inputs.items():
            references.append(reference)
            values.append(inputs[name] / scale)
        if references:
            self._call("its inputs", self._set, references, values)
        done = self._call("its step", self._fmu.doStep, self._steps * TICK_S, TICK_S)
        if done is not None and (done[1] or done[2]):  # FMI 3: it ends, or returned early.
            raise self._error("its step", "it ended by itself")
        self._steps += 1

    def _call(self, what: str, function: Any, *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except Exception as error:  # FMPy raises plain exceptions.
            reason = (
                f"{str(error).rstrip('.')}: try it with these values in the program that made it"
            )
            raise self._error(what, reason) from error

    def _error(self, what: str, reason: str) -> ModelError:
        texts = ((told[-1] or b"").decode(errors="replace") for told in self._said)
        said = "".join(f"; it says: {' '.join(text.split())}" for text in texts)
        text = f"at {self._steps * TICK_S:.2f} s, {what}: {reason}{said}"
        return ModelError(errno.EIO, text, str(self._section.file))


def _end(fmu: Any, folder: str) -> None:
    try:
        fmu.freeInstance()
    finally:
        shutil.rmtree(folder)


class FmuPlant(Plant):
    """Plant whose ship and tank are an FMU; `losses_j` and `strikes` of it are not known.

    Pressure and flow are exchanged every tick, the mean pressure of the pump's steps and the flow
    at their start; the wave moment is that of the middle of the tick.
    """

    def __init__(
        self, fmu: FmuFile, ship: RollShip, tank: Tank, pump: Pump | None, waves: Waves
    ) -> None:
        super().__init__(ship, tank, pump, waves)
        self._fmu = RunningFmu(fmu)
        self._keep(self._fmu.outputs())
        self._show()

    def _tick(self, phasors: ComplexArray, rotations: ComplexArray) -> None:
        state, area_m2 = self._state, self._area_m2
        if math.isinf(state[kernel.CAPSIZED]):
            pressure_pa = pump_tick(state, self._coefficients, area_m2, len(self._weights) // 2)
            moments = state[kernel.MOMENTS]
            moment_nm = kernel.interpolated(self._weights, len(self._weights) // 2, moments)
            roll_rad, level_m = state[kernel.ROLL], state[kernel.LEVEL]
            self._fmu.step(
                {
                    "pressure_pa": pressure_pa,
                    "wave_moment_nm": moment_nm,
                    "valve_loss_pa_s2_m2": float(state[kernel.VALVE_LOSS]),
                }
            )
            self._keep(self._fmu.outputs())
            state[kernel.WAVE_WORK] += moment_nm * (state[kernel.ROLL] - roll_rad)
            state[kernel.PUMP_WORK] += pressure_pa * area_m2 * (state[kernel.LEVEL] - level_m)
            if abs(state[kernel.ROLL]) >= kernel.CAPSIZE_RAD:
                state[kernel.CAPSIZED] = state[kernel.TIME] + TICK_S
                state[kernel.ROLL_RATE] = state[kernel.LEVEL_RATE] = 0.0
        state[kernel.TIME] += TICK_S
        ahead = state[kernel.MOMENTS]
        ahead[:3] = ahead[1:].copy()
        ahead[3] = kernel.turned_sum(phasors[0], rotations[0])

    def _keep(self, outputs: dict[str, float]) -> None:
        state = self._state
        state[kernel.ROLL], state[kernel.ROLL_RATE] = (
            outputs["roll_rad"],
            outputs["roll_rate_rad_s"],
        )
        state[kernel.LEVEL] = outputs["level_m"]
        state[kernel.LEVEL_RATE] = outputs["flow_m3_s"] / self._area_m2
        state[kernel.SWAY_NOW] = outputs.get("lateral_m_s2", 0.0) / GRAVITY_M_S2


@njit(error_model="numpy")
def pump_tick(
    state: FloatArray, coefficients: tuple[float, ...], area_m2: float, steps: int
) -> float:
    """Advance the pump by a tick at the flow of the state; return its mean pressure."""
    c, pump = PumpCoefficients(*coefficients), kernel.kept_pump(state)
    pressure_pa = 0.0
    for _ in range(steps):
        pump = kernel.pump_after(state, pump, area_m2 * state[kernel.LEVEL_RATE], c)
        state[kernel.SHAFT_WORK] += pump.power_w * kernel.STEP_S
        pressure_pa += pump.pressure_pa / steps
    kernel.keep_pump(state, pump)
    return pressure_pa
