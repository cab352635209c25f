"""``utank-hil identify decay`` and ``inclining``: what tests of the ship say."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
import typer

from utank_hil.analysis.loop.margins import PERIOD_SCALES
from utank_hil.analysis.motion.decay import RollDecay, roll_decay
from utank_hil.analysis.motion.inclining import inclining
from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import ALWAYS, Between
from utank_hil.base.provenance import describe
from utank_hil.configuration import Vessel
from utank_hil.console import common
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.terminal import Terminal, new_table, notes, say_note
from utank_hil.dynamics.tank import GRAVITY_M_S2

PICTURE = "decay.png"


def decay(
    context: typer.Context,
    record: Annotated[Path, common.argument("Roll against time: a log or a table.")],
    ship: Annotated[
        Path | None, common.option("Ship whose GM turns the quadratic part into its key.")
    ] = None,
    from_s: common.From = None,
    to_s: common.To = None,
    out: common.Out = common.OUT,
    json_: common.Json = False,
) -> None:
    """Find roll period and damping in a free decay, with intervals of 95 %.

    The tank is empty or shut, the water still. Columns: time_s, and roll_rad or roll_deg. --from
    and --to leave out the pull and the end of the run.

    Exit code 1: the record is no free decay; the reason is printed.

    **Example:** utank-hil identify decay roll.csv --from 25 --ship configs/ships/naval_vessel.yaml
    """
    from utank_hil.pictures.identification import draw_decay

    low_s, high_s = common.chosen_part(from_s, to_s)
    vessel = None if ship is None else common.load(ship, Vessel)
    _, columns = read_run(record, ("time_s", "roll_rad"), (low_s, high_s))
    time_s, roll_rad = columns["time_s"], columns["roll_rad"]
    part = (time_s >= low_s) & (time_s <= high_s)
    try:
        found = roll_decay(time_s[part], roll_rad[part])
    except ValueError as error:
        refuse(f"{record}: {error}; --from and --to choose a part", json_)
    out = common.prepare_out(out, (PICTURE,))
    about = (
        {} if vessel is None else describe("identify decay", vessel, out, options=context.params)
    )
    path = draw_decay(found, out / PICTURE, record.name, about)
    keys, warnings = ship_keys(found, vessel), list(found.warnings)
    if vessel is not None:
        own_s = 2 * math.pi / vessel.ship.natural_frequency_rad_s
        if not PERIOD_SCALES[0] <= found.period_s / own_s <= PERIOD_SCALES[-1]:
            reason = "is this the record of a model, or of another ship or loading?"
            warnings.append(f"{vessel.name} rolls in {own_s:.3g} s: {reason}")
    if not json_:
        _print_decay(Terminal(), found, keys, warnings, vessel, path)
        return
    plain = {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in asdict(found).items()
        if name not in ("time_s", "roll_rad", "fit_rad")
    }
    common.print_json(about | plain | {"ship": keys, "warnings": warnings, "picture": str(path)})


def ship_keys(found: RollDecay, vessel: Vessel | None) -> dict[str, float]:
    """Return the keys of a ship's file that a decay test gives.

    The ratio is the linear part beside the quadratic one, which needs a vessel's GM. Alone, or
    where the linear part is negative, which no file can have, it is the equivalent in the middle.
    """
    keys = {"roll_period_s": found.period_s, "damping_ratio": float(found.equivalent_ratio[1])}
    if found.damping_ratio >= 0 and vessel is not None:
        inertia = vessel.ship.stiffness_nm_rad * (found.period_s / (2 * math.pi)) ** 2
        keys["damping_ratio"] = found.damping_ratio
        keys["quadratic_damping_nms2_rad2"] = max(0.0, inertia * found.quadratic_per_rad)
    return {name: float(f"{value:.4g}") for name, value in keys.items()}


def inclining_test(
    record: Annotated[Path, common.argument("Table: moment_nm, and heel_rad or heel_deg.")],
    displacement_t: Annotated[
        float, common.option("Of the ship as it lay, t.", "--displacement", min=1e-3)
    ],
    json_: common.Json = False,
) -> None:
    """Find GM in an inclining test: a row a position of the weights.

    Exit code 1: no GM follows from the table; the reason is printed.

    **Example:** utank-hil identify inclining shifts.csv --displacement 1900
    """
    _, table = read_run(record, ("moment_nm", "heel_rad"))
    try:
        weight_n = 1e3 * GRAVITY_M_S2 * displacement_t
        found = inclining(table["moment_nm"], table["heel_rad"], weight_n)
    except ValueError as error:
        refuse(f"{record}: {error}", json_)
    if json_:
        common.print_json(found._asdict())
        return
    low, high = found.interval_m
    terminal = Terminal()
    terminal.say(f"GM {found.gm_m:.3f} m, 95 % in {low:.3f} to {high:.3f} m, slack tanks included.")
    terminal.say(f"The ship lists by {math.degrees(found.list_rad):.2f}°.")


def read_run(
    path: Path,
    needed: Sequence[str],
    between_s: Between = ALWAYS,
    also: Sequence[str] = (),
    *,
    channel: str | None = None,
    run: str | None = None,
) -> tuple[str, dict[str, FloatArray]]:
    """Name and columns of a run, by default the last; it ends the command without the `needed`."""
    from utank_hil.telemetry.signal_files import read_signals, require

    with common.failing(OSError, ValueError):
        names = (*needed, *also)
        runs = read_signals(path, say_note, channel=channel, names=names, between_s=between_s)
        name = common.chosen_run(path, runs, run)
        require(path, runs[name], *needed)
    return name, runs[name]


def refuse(reason: str, json_: bool) -> NoReturn:
    """Print why nothing follows from a record, and end."""
    notes.say(reason, red="refused:")
    if json_:
        common.print_json({"accepted": False, "reasons": [reason]})
    raise typer.Exit(ExitCode.REFUSED)


def _print_decay(
    terminal: Terminal,
    found: RollDecay,
    keys: dict[str, Any],
    warnings: Sequence[str],
    vessel: Vessel | None,
    path: Path,
) -> None:
    table = new_table("Free decay", "value", "95 %")
    for name, value, (low, high), digits in (
        ("natural period, s", found.period_s, found.period_interval_s, 3),
        ("linear damping ratio", found.damping_ratio, found.ratio_interval, 4),
        ("quadratic damping per inertia, 1/rad", found.quadratic_per_rad,
         found.quadratic_interval_per_rad, 3),
    ):  # fmt: skip
        table.add_row(name, f"{value:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}")
    amplitudes_deg = np.degrees(found.amplitude_rad)
    for amplitude, ratio, (low, high) in zip(
        amplitudes_deg, found.equivalent_ratio, found.equivalent_interval, strict=True
    ):
        name = f"damping ratio at {amplitude:.1f}°"
        table.add_row(name, f"{ratio:.4f}", f"{low:.4f} to {high:.4f}")
    if found.halves_ratio is not None:
        one, two = found.halves_ratio
        table.add_row("  by either half of the record", f"{one:.4f}, {two:.4f}", "")
    table.add_row("heel", f"{math.degrees(found.heel_rad):.3f}°", "")
    table.add_row("left by the fit, per greatest roll", f"{found.residual_share:.2%}", "")
    terminal.table(table)
    least, _, most = amplitudes_deg
    terminal.say(f"It holds from {least:.1f} to {most:.1f}°, and nowhere else.")
    for warning in warnings:
        terminal.say(warning, yellow="warning:")
    terminal.say("Keys of the ship:")
    for name, value in keys.items():
        terminal.say(f"  {name}: {value:g}")
    if "quadratic_damping_nms2_rad2" not in keys:
        terminal.say(f"The ratio is that at {amplitudes_deg[1]:.1f}°.")
    if vessel is None and found.damping_ratio >= 0:
        terminal.say("--ship SHIP.yaml gives both parts: the quadratic one needs its GM.")
    terminal.say(f"Picture: {path}")
