"""Output of ``utank-hil identify``: tables for people, figures for scripts."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.table import Table

from utank_hil.base.finite import finite
from utank_hil.console.terminal import Terminal, new_table
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.identification import IdentificationError, ModalConfidence, modal_confidence
from utank_hil.retuning import Candidate, Refusal
from utank_hil.retuning.redesign import Identification, RetuningTask

STATES: Final = 4
QUANTILE: Final = 1.96  #: Number of standard deviations to either side of a 95 % interval.


def realized_modes(found: Identification) -> ModalConfidence | None:
    """Return the modes of the model without physics; None if it has none with deviations."""
    try:
        return modal_confidence(found.okid, STATES)
    except (IdentificationError, ValueError):
        return None


def figures(
    found: Identification, answer: Candidate | Refusal, files: Mapping[str, Path]
) -> dict[str, Any]:
    """Return all results for ``--json``; deviations are relative standard deviations."""
    fit, validation = found.fit, found.validation
    modes = realized_modes(found)
    return {
        "accepted": isinstance(answer, Candidate),
        "reasons": [] if isinstance(answer, Candidate) else list(answer.reasons),
        "wave_frequencies_rad_s": list(found.wave_frequencies_rad_s),
        "roll_period_s": 2 * math.pi / fit.ship.natural_frequency_rad_s,
        "roll_period_deviation": fit.period_deviation,
        "inertia_kg_m2": fit.ship.inertia_kg_m2,
        "stiffness_nm_rad": fit.ship.stiffness_nm_rad,
        "damping_nms_rad": fit.ship.damping_nms_rad,
        "tank_damping_ratio": fit.tank.damping_ratio,
        "deviations": fit.deviation.tolist(),
        "later_s": fit.extra_delay_s.tolist(),
        "pressure_over_command": fit.pressure_gain,
        "dispersion": fit.dispersion,
        "held_out_fit": finite(validation.one_step_fit.tolist()),
        "simulation_fit": finite(validation.simulation_fit.tolist()),
        "error_correlation": abs(validation.residual_correlation).max(axis=0).tolist(),
        "whiteness_probability": validation.whiteness_probability.tolist(),
        "input_correlation": abs(validation.input_correlation).max(axis=(0, 2)).tolist(),
        "independence_probability": validation.independence_probability.ravel().tolist(),
        "modes": [] if modes is None else _mode_figures(modes),
        "law": dataclasses.asdict(answer.summary) if isinstance(answer, Candidate) else None,
        "files": {name: str(path) for name, path in files.items()},
    }


def _mode_figures(found: ModalConfidence) -> list[dict[str, float]]:
    columns = {
        "frequency_rad_s": found.modes.frequency_rad_s,
        "frequency_std_rad_s": found.frequency_std_rad_s,
        "damping_ratio": found.modes.damping_ratio,
        "damping_ratio_std": found.damping_ratio_std,
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def print_report(
    console: Terminal,
    found: Identification,
    task: RetuningTask,
    answer: Candidate | Refusal,
    files: Mapping[str, Path],
) -> None:
    """Print the ship, its uncertainty, the validation and the acceptance."""
    console.table(_ship_table(found, task))
    console.table(_mode_table(found, task))
    console.table(_check_table(found, task))
    console.say(_waves(found))
    if isinstance(answer, Candidate):
        console.say(
            f"peak sensitivity {answer.summary.peak_sensitivity:.2f}; in the recorded waves "
            f"{answer.summary.roll_below_passive:.0%} less roll than passive.",
            green="Accepted:",
        )
    else:
        for reason in answer.reasons:
            console.say(reason, red="refused:")
    console.files(files)


def _waves(found: Identification) -> str:
    waves = found.wave_frequencies_rad_s
    if not waves:
        return "Waves: no regular one found; an irregular sea is in the model of the errors."
    named = (f"{w:.4f} rad/s ({2 * math.pi / w:.2f} s)" for w in waves)
    return f"Waves: regular, {', '.join(named)}, taken out."


def _ship_table(found: Identification, task: RetuningTask) -> Table:
    fit = found.fit
    table = new_table("Ship and tank", "configured", "identified", "change", "± 95 %")
    before = task.plant
    inertia, stiffness, damping, tank = fit.deviation.tolist()
    rows = (
        ("roll period, s", 2 * math.pi / before.ship.natural_frequency_rad_s,
         2 * math.pi / fit.ship.natural_frequency_rad_s, fit.period_deviation),
        ("inertia, t m²", before.ship.inertia_kg_m2 / 1e3, fit.ship.inertia_kg_m2 / 1e3, inertia),
        ("stiffness, MN m/rad", before.ship.stiffness_nm_rad / 1e6,
         fit.ship.stiffness_nm_rad / 1e6, stiffness),
        ("damping, MN m s/rad", before.ship.damping_nms_rad / 1e6, fit.ship.damping_nms_rad / 1e6,
         damping),
        ("tank damping ratio", before.tank.damping_ratio, fit.tank.damping_ratio, tank),
    )  # fmt: skip
    for name, configured, identified, deviation in rows:
        table.add_row(
            name,
            f"{configured:.4g}",
            f"{identified:.4g}",
            f"{identified / configured - 1:+.1%}" if configured else "",
            f"{QUANTILE * deviation:.2%}",
        )
    measured = task.design.predictor.measured
    later = ", ".join(
        f"{name} {1e3 * late_s:+.0f} ms"
        for name, late_s in zip(measured, fit.extra_delay_s.tolist(), strict=True)
    )
    table.caption = (
        f"delay against the configured one: {later}; "
        f"pressure {fit.pressure_gain - 1:+.1%} of the command; "
        f"misfit {fit.dispersion:.1f} times its uncertainty (limit {task.limits.dispersion:g})"
    )
    return table


def _mode_table(found: Identification, task: RetuningTask) -> Table:
    table = new_table(
        "Modes of ship and tank together", "configured", "identified", "without\nphysics", "± 95 %"
    )
    configured = _modes(task.plant.ship, task.plant.tank)
    fitted = _modes(found.fit.ship, found.fit.tank)
    realized = realized_modes(found)
    for number, ((w0, z0), (w1, z1)) in enumerate(zip(configured, fitted, strict=True), start=1):
        free = [("", ""), ("", "")]
        if realized is not None:
            modes = realized.modes
            swinging = np.where(modes.damping_ratio < 1, modes.frequency_rad_s, np.inf)
            k = int(np.argmin(abs(swinging - w1)))
            free = [
                (f"{value:.4f}", f"{QUANTILE * deviation:.4f}")
                for value, deviation in (
                    (float(modes.frequency_rad_s[k]), float(realized.frequency_std_rad_s[k])),
                    (float(modes.damping_ratio[k]), float(realized.damping_ratio_std[k])),
                )
            ]
        table.add_row(f"{number}: frequency, rad/s", f"{w0:.4f}", f"{w1:.4f}", *free[0])
        table.add_row("   damping ratio", f"{z0:.4f}", f"{z1:.4f}", *free[1])
    table.caption = "without physics: nearest mode of OKID and ERA, ± if the errors are white"
    return table


def _modes(ship: RollShip, tank: Tank) -> list[tuple[float, float]]:
    poles = np.linalg.eigvals(state_matrices(ship, tank)[0])
    frequency = abs(poles)
    order = np.argsort(frequency)[::2]  # One of each pair is taken.
    return [(float(frequency[k]), float(-poles[k].real / frequency[k])) for k in order]


def _check_table(found: Identification, task: RetuningTask) -> Table:
    validation, limits = found.validation, task.limits
    table = new_table(
        "On held-out data",
        "one-step\nfit", "simulation\nfit", "errors\ncorrelated", "if\nwhite",
         "with the\ninput", "if\napart",
    )  # fmt: skip
    for column, name in enumerate(task.design.predictor.measured):
        table.add_row(
            name,
            f"{validation.one_step_fit[column]:.3f}",
            f"{validation.simulation_fit[column]:.3f}",
            f"{abs(validation.residual_correlation[:, column]).max():.2f}",
            _probability(float(validation.whiteness_probability[column])),
            f"{abs(validation.input_correlation[:, column]).max():.2f}",
            _probability(float(validation.independence_probability[column].min())),
        )
    table.caption = (
        f"{validation.rows} predictions; fit {limits.fit:g} or more and correlation "
        f"{limits.correlation:g} or less are asked for; 'if' is the probability of more by chance"
    )
    return table


def _probability(value: float) -> str:
    return "< 0.001" if value < 1e-3 else f"{value:.3f}"
