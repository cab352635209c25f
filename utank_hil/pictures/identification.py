"""Figures of identifications: validation of a model on held-out data, and a decay test."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import welch

from utank_hil.analysis.motion.decay import RollDecay
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant
from utank_hil.dynamics.sampling import state_space_response
from utank_hil.identification import disturbance_basis
from utank_hil.pictures.style import BELOW, COLORS, DASHES, WIDEST_IN, picture
from utank_hil.retuning.redesign import Identification, RetuningTask
from utank_hil.retuning.settings import estimation_samples

SHOWN_S = 120.0  #: Length of the held-out record in the figure. Chosen; no study.
SEGMENT_S = 200.0  #: Of a spectrum: 0.03 rad/s apart. Chosen; no study.
BAND_RAD_S = np.linspace(0.15, 1.5, 300)  #: Rolls of 4 to 42 s.


def draw_identification(
    record: FloatArray,
    found: Identification,
    task: RetuningTask,
    path: Path,
    title: str,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Draw held-out roll, prediction, responses and residuals of a `record`, shape (N, 1 + m)."""
    measured = task.design.predictor.measured
    roll, arx = measured.index("roll_rad"), found.okid.arx
    step_s = arx.sample_time_s
    split = estimation_samples(len(record))
    shown = slice(split, min(len(record), split + arx.order + round(SHOWN_S / step_s)))
    here = np.nan_to_num(record[shown])
    basis = disturbance_basis(len(here), step_s, found.wave_frequencies_rad_s, 0)
    predicted = arx.predict(here[:, :1], here[:, 1:])[arx.order :, roll]
    waves, measured_roll = basis[:, arx.order :].T, here[arx.order :, roll + 1]
    predicted = predicted + waves @ np.linalg.lstsq(waves, measured_roll - predicted, rcond=None)[0]
    time_s = np.arange(shown.start + arx.order, shown.stop) * step_s
    z = np.exp(1j * BAND_RAD_S * step_s)
    powers = z[:, None] ** -np.arange(arx.order + 1)
    left = np.eye(arx.outputs) - np.einsum("wi,iab->wab", powers[:, 1:], arx.alpha)
    responses = {
        "configured": _ship_response(task, task.plant, z),
        "ARX model": np.linalg.solve(left, np.einsum("wi,iab->wab", powers, arx.beta)),
        "identified ship": _ship_response(task, found.plant(task), z),
    }
    with picture(path, title, (WIDEST_IN, 7.5), about) as figure:
        places = figure.subplot_mosaic([["above", "above"], ["bode", "residuals"]])
        above, bode, residuals = (places[name] for name in ("above", "bode", "residuals"))
        above.plot(time_s, np.rad2deg(measured_roll), color=COLORS[0], label="measured")
        above.plot(time_s, np.rad2deg(predicted), color=COLORS[1], lw=1.0, label="predicted")
        above.set(xlabel="Time (s)", ylabel="Roll (°), held out")
        above.legend(frameon=False)
        for (name, response), color in zip(responses.items(), COLORS, strict=False):
            size = np.rad2deg(np.abs(response[:, roll, 0])) * 10e3
            bode.semilogy(BAND_RAD_S, size, color=color, label=name)
        bode.set(xlabel="Frequency (rad/s)", ylabel="Roll for 10 kPa of the pump (°)")
        bode.legend(frameon=False)
        correlation = found.validation.residual_correlation
        lags_s = np.arange(1, len(correlation) + 1) * step_s
        for column, name in enumerate(measured):
            color, dash = COLORS[1 + column], DASHES[1 + column]
            residuals.plot(lags_s, correlation[:, column], ".", ls=dash, color=color, label=name)
        bound = 1.96 / math.sqrt(found.validation.rows)
        residuals.axhspan(-bound, bound, color=COLORS[0], alpha=0.15, lw=0)
        ordinate = "Autocorrelation of held-out errors"
        residuals.set(xlabel="Lag (s)", ylabel=ordinate, ylim=(-0.6, 0.6))
        residuals.legend(frameon=False)
    return path


def _ship_response(task: RetuningTask, plant: DesignPlant, z: ComplexArray) -> ComplexArray:
    predictor = task.design.predictor
    return state_space_response(plant.sampled(predictor.measured, predictor.sample_time_s), z)


def draw_decay(
    found: RollDecay, path: Path, title: str, about: Mapping[str, Any] | None = None
) -> Path:
    """Draw measured roll, the fit, and what the fit leaves."""
    with picture(path, title, (WIDEST_IN, 5.5), about) as figure:
        top, low = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        for n, (name, roll) in enumerate((("measured", found.roll_rad), ("fit", found.fit_rad))):
            style: dict[str, Any] = {"linestyle": DASHES[2 * n], "color": COLORS[2 * n]}
            top.plot(found.time_s, np.degrees(roll), label=name, **style)
        top.set_ylabel("Roll (°)")
        low.plot(found.time_s, np.degrees(found.roll_rad - found.fit_rad), color=COLORS[0], lw=0.8)
        low.set(xlabel="Time (s)", ylabel="Less fit (°)")
        figure.legend(**BELOW)
    return path


def draw_waves(
    roll_rad: FloatArray, slope_rad: FloatArray, step_s: float, path: Path, title: str,
    about: Mapping[str, Any] | None = None,
) -> Path:  # fmt: skip
    """Draw the wave slope of a record beside its roll, and the energy of both by frequency."""
    with picture(path, title, (WIDEST_IN, 5.5), about) as figure:
        top, low = figure.subplots(2, 1)
        time_s = step_s * np.arange(len(roll_rad))
        segment = min(len(roll_rad), round(SEGMENT_S / step_s))
        for n, (name, values) in enumerate((("wave slope", slope_rad), ("roll", roll_rad))):
            style: dict[str, Any] = {"linestyle": DASHES[2 * n], "color": COLORS[2 * n]}
            degrees = np.degrees(values)
            top.plot(time_s, degrees, label=name, lw=0.8, **style)
            frequency_hz, density = welch(degrees, 1 / step_s, nperseg=segment)
            low.plot(2 * np.pi * frequency_hz, density / (2 * np.pi), **style)
        top.set(xlabel="Time (s)", ylabel="Angle (°)")
        low.set(xlabel="Frequency (rad/s)", ylabel="Density (°² s/rad)", xlim=(0, 2.5))
        figure.legend(**BELOW)
    return path
