"""Bode and Nyquist plots of a set of laws on a ship."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.analysis.loop.comparison import NO_TANK, PASSIVE, Loop
from utank_hil.analysis.loop.margins import loop_response
from utank_hil.analysis.loop.robustness import PEAK_SENSITIVITY
from utank_hil.analysis.loop.sea_response import roll_response_without_tank
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.ship import RollShip
from utank_hil.pictures.style import COLORS, STROKES, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_bode(
    loops: Sequence[Loop],
    plant: DesignPlant,
    path: Path,
    title: str,
) -> Path:
    """Bode plot of the roll per effective wave slope, without and with the tank.

    The effective wave slope is the wave moment over the ship's roll stiffness. The responses are
    those of the sampled laws on the continuous plant.

    Parameters
    ----------
    loops : sequence of Loop
        One to seven laws; the passive tank is always drawn.

    Raises
    ------
    ValueError
        If there are no laws, or more than there are colours.
    """
    from matplotlib.ticker import LogLocator, MultipleLocator

    _check_number(loops)
    ship = plant.ship
    w = ship.natural_frequency_rad_s * np.geomspace(0.2, 5.0, 3000)
    system = coupled_model(ship, plant.tank)
    row = system.output_labels.index("roll_rad")
    with picture(path, title, (9.0, 7.0)) as figure:
        axes = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        without = {"label": NO_TANK, "color": "#AAAAAA", "linestyle": ":"}
        _add_bode(axes, w, ship, roll_response_without_tank(ship, w), without)
        passive, _ = closed_loop_response(None, system, (), w)
        _add_bode(axes, w, ship, passive[:, row], {"label": PASSIVE, "color": COLORS[0]})
        for loop, stroke in zip(loops, STROKES[1:], strict=False):
            active, _ = closed_loop_response(
                loop.law, system, loop.measured, w, plant.delay_s, plant.lag_s
            )
            _add_bode(axes, w, ship, active[:, row], {"label": loop.name, **stroke})
        axes[0].set_ylabel("Roll per effective wave slope")
        axes[1].set_ylabel("Phase (°)")
        axes[1].set_xlabel("Wave frequency (rad/s)")
        axes[1].yaxis.set_major_locator(MultipleLocator(90))
        axes[1].xaxis.set_minor_locator(LogLocator(subs=(2, 3, 5)))
        axes[1].xaxis.set_major_formatter("{x:g}")
        axes[1].xaxis.set_minor_formatter("{x:g}")
        axes[0].yaxis.set_major_formatter("{x:g}")
        axes[1].set_xlim(w[0], w[-1])
        figure.align_ylabels()
        axes[0].legend(frameon=False)
    return path


def draw_nyquist(
    loops: Sequence[Loop],
    plant: DesignPlant,
    path: Path,
    title: str,
) -> Path:
    """Nyquist plot of the open-loop transfer functions, opened at the pump.

    Drawn as -L with the critical point -1, as for negative feedback. Inside the circle around it
    the sensitivity is above `PEAK_SENSITIVITY`; a law that enters it is refused. Arguments and
    errors as for `draw_bode`.
    """
    _check_number(loops)
    angle = np.linspace(0, 2 * np.pi, 361)
    circle = np.exp(1j * angle)
    with picture(path, title, (8.0, 8.6)) as figure:
        axes = figure.add_subplot()
        axes.plot(circle.real, circle.imag, color="#AAAAAA", linewidth=0.9, linestyle=":")
        forbidden = -1 + circle / PEAK_SENSITIVITY
        axes.fill(forbidden.real, forbidden.imag, color=COLORS[2], alpha=0.13, linewidth=0)
        axes.plot(forbidden.real, forbidden.imag, color=COLORS[2], linewidth=0.9)
        axes.plot(-1, 0, marker="+", color=COLORS[2], markersize=11, markeredgewidth=1.6)
        axes.annotate(
            f"sensitivity\nabove {PEAK_SENSITIVITY:g}",
            (-1, -1 / PEAK_SENSITIVITY),
            xytext=(0, -4),
            textcoords="offset points",
            ha="center",
            va="top",
            color=COLORS[2],
        )
        shown = [forbidden, circle]
        for loop, stroke in zip(loops, STROKES[1:], strict=False):
            curve = -_loop(loop, plant)
            axes.plot(curve.real, curve.imag, linewidth=1.6, label=loop.name, **stroke)
            axes.plot(curve.real, -curve.imag, linewidth=0.8, **stroke)
            shown.append(curve)
        _fit_axes(axes, np.concatenate(shown))
        axes.set_xlabel("Real part of −L")
        axes.set_ylabel("Imaginary part of −L")
        figure.legend(loc="outside lower left", ncols=len(loops), frameon=False)
    return path


def _check_number(loops: Sequence[Loop]) -> None:
    if not 1 <= len(loops) < len(COLORS):
        raise ValueError(
            f"can draw 1 to {len(COLORS) - 1} laws in one picture beside the passive tank, got "
            f"{len(loops)}"
        )


def _add_bode(
    axes: "Sequence[Axes]",
    w: FloatArray,
    ship: RollShip,
    roll_per_moment: ComplexArray,
    stroke: dict[str, Any],
) -> None:
    response = ship.stiffness_nm_rad * roll_per_moment
    axes[0].loglog(w, np.abs(response), linewidth=1.6, **stroke)
    axes[1].semilogx(w, np.rad2deg(np.unwrap(np.angle(response))), linewidth=1.6, **stroke)
    for axis in axes:
        axis.grid(visible=True, which="minor", axis="x", linewidth=0.4)


def _loop(loop: Loop, plant: DesignPlant) -> ComplexArray:
    """L up to the Nyquist frequency, dense around the ship's natural frequency."""
    sampled = plant.sampled(loop.measured, loop.law.sample_time_s)
    roll = plant.ship.natural_frequency_rad_s
    w = np.unique(
        np.concatenate(
            [
                np.geomspace(1e-3 * roll, np.pi / loop.law.sample_time_s, 2000),
                roll * np.linspace(0.3, 3.0, 4000),
            ]
        )
    )
    return loop_response(loop.law, sampled, w[w <= np.pi / loop.law.sample_time_s])


def _fit_axes(axes: "Axes", points: ComplexArray) -> None:
    """Fit axes with equal scales to the curves and their mirror images."""
    low, high = points.real.min(), points.real.max()
    half = 1.05 * max((high - low) / 2, np.abs(points.imag).max())
    axes.set_xlim((low + high) / 2 - half, (low + high) / 2 + half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal")
    axes.axhline(0, color="#888888", linewidth=0.7, zorder=1)
    axes.axvline(0, color="#888888", linewidth=0.7, zorder=1)
