"""WAMIT: ``.1``, ``.3`` or ``.2``, ``.hst``, and what ``.gdf .frc .pot .cfg`` add beside them.

Numbers are made dimensional with the density, gravity and the length ULEN of the ``.gdf``::

    A = a rho L^k,  B = b rho L^k w,  X = x rho g L^m,  C = c rho g L^q
    k = 3, 4, 5 and q = 2, 3, 4 with no, one, two indices of rotation; m = 2, 3

The ``.hst`` has the weight's part in it. Form 1 of the ``.frc`` has the radii of gyration about the
body's origin.
"""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.configuration.hull_files import parts
from utank_hil.dynamics.hull.hull_data import HullData

_TURNS = np.array([0, 0, 0, 1, 1, 1])
_PAIR = _TURNS[:, None] + _TURNS


def read_wamit(path: Path, given: parts.Given) -> HullData:
    """Read the files beside a ``.1``."""
    rows = parts.table(path, 4)
    _refuse_gaps(path, [row[:1] for row in rows])
    config = parts.text(found) if (found := parts.sibling(path, ".cfg")) else ""
    by_frequency = _option(config, "IPEROUT")
    if by_frequency not in (1, 2):
        raise ValueError(f"{path}: first column is a wave number (IPEROUT {by_frequency}): use 1")
    unit_m, gravity = _unit_and_gravity(path)
    place, depth = _place(path)
    body: dict[str, Any] = {}
    lift_kgm = 0.0
    density = given.density_kg_m3
    if force := parts.sibling(path, ".frc"):
        density, body, lift_kgm = _body(force, _option(config, "IALTFRC"), given, place)
    if density is None:
        raise ValueError(f"{path}: density_kg_m3 is missing: WAMIT's numbers are non-dimensional")

    def at(first: float) -> float:
        """Return the frequency of a first column: of a period, -1 is zero and 0 infinity."""
        if by_frequency == 2:
            return np.inf if first < 0 else first
        return 0.0 if first < 0 else np.inf if first == 0 else 2 * np.pi / first

    first = {at(row[0]): np.zeros((2, 6, 6)) for row in rows}
    for row in rows:
        i, j = parts.mode(path, row[1]), parts.mode(path, row[2])
        first[at(row[0])][:, i, j] = [*row[3:5], 0.0][:2]
    scale = density * unit_m ** (3 + _PAIR)
    omega = np.array(sorted(w for w in first if 0 < w < np.inf))
    waves, headings, excitation = _excitation(path, at)
    hydrostatic = None
    if stiff := parts.sibling(path, ".hst"):
        hydrostatic = np.zeros((6, 6))
        for row in parts.table(stiff, 3):
            hydrostatic[parts.mode(stiff, row[0]), parts.mode(stiff, row[1])] = row[2]
        hydrostatic = hydrostatic * density * gravity * unit_m ** (2.0 + _PAIR)
        hydrostatic[[3, 4], [3, 4]] -= lift_kgm * gravity
    return parts.hull_of(
        path,
        [
            ""
            if parts.sibling(path, ".gdf")
            else "no .gdf beside it: ULEN is taken as 1 m, g as 9.81",
            "roll damping is that of waves alone: add the viscous part",
        ],
        frequency_rad_s=omega,
        added_mass=np.array([scale * first[w][0] for w in omega]),
        damping=np.array([scale * w * first[w][1] for w in omega]),
        wave_frequency_rad_s=waves,
        heading_deg=headings,
        excitation=excitation * density * gravity * unit_m ** (2.0 + _TURNS),
        hydrostatic=hydrostatic,
        reference_m=place,
        density_kg_m3=density,
        gravity_m_s2=gravity,
        water_depth_m=depth,
        infinite_added_mass=scale * first[np.inf][0] if np.inf in first else None,
        **body,
    )


def _excitation(
    path: Path, at: Callable[[float], float]
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Frequencies, headings and numbers of the ``.3`` or ``.2``; `at` is of its first column."""
    forces = parts.sibling(path, ".3") or parts.sibling(path, ".2")
    if forces is None:
        raise ValueError(f"{path}: the excitation is missing: put the .3 or .2 beside it")
    rows = np.array([[at(row[0]), *row[1:7]] for row in parts.table(forces, 7)])
    _refuse_gaps(forces, rows[:, :2])
    waves, headings = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    excitation = np.zeros((len(headings), len(waves), 6), dtype=np.complex128)
    where = (
        np.searchsorted(headings, rows[:, 1]),
        np.searchsorted(waves, rows[:, 0]),
        np.array([parts.mode(forces, number) for number in rows[:, 2]]),
    )
    excitation[where] = rows[:, 5] + 1j * rows[:, 6]
    return waves, headings, excitation


def _refuse_gaps(path: Path, begin: npt.ArrayLike) -> None:
    """Refuse rows that are not as many for each value of their first columns, shape (n, m)."""
    groups, counts = np.unique(np.asarray(begin), axis=0, return_counts=True)
    usual = int(np.median(counts))
    odd = groups[counts != usual]
    if len(odd) or len(groups) != math.prod(len(np.unique(column)) for column in groups.T):
        where = f", not after {', '.join(f'{each:g}' for each in odd[0])}" if len(odd) else ""
        raise ValueError(
            f"{path}: has {usual} rows after most{where}: it is cut, or has rows twice"
        )


def _option(config: str, name: str) -> int:
    found = re.search(rf"(?im)^\s*{name}\s*=\s*(\d+)", config)
    return int(found.group(1)) if found else 1


def _unit_and_gravity(path: Path) -> tuple[float, float]:
    if (found := parts.sibling(path, ".gdf")) is None:
        return 1.0, parts.GRAVITY_M_S2
    lines = parts.text(found).splitlines()
    numbers = parts.floats(lines[1]) if len(lines) > 1 else []
    if len(numbers) < 2:
        raise ValueError(f"{found}: line 2 must hold ULEN and GRAV")
    return numbers[0], numbers[1]


def _body(
    path: Path, form: int, given: parts.Given, place: list[float]
) -> tuple[float | None, dict[str, Any], float]:
    """Return density, and mass, centre and inertia of the ``.frc``, as far as it has them.

    To that comes the mass times the height of the given centre above that of the ``.hst``.
    """
    lines = [parts.floats(line) for line in parts.text(path).splitlines()[1:]]
    lines = [line for line in lines if line][1:]  # without the options
    origin = np.array(place)
    if form == 2:
        body = parts.rigid_body(np.array(lines[3:9])[:, :6], origin) if lines[2][0] else {}
        return lines[0][0], body | {"gravity_centre_m": lines[1][:3] + origin}, 0.0
    z_m, about_origin = lines[0][0], np.array([line[:3] for line in lines[1:4]])
    if given.mass_kg is None or given.gravity_centre_m is None:
        return given.density_kg_m3, {}, 0.0
    centre = np.array(given.gravity_centre_m) - origin
    if not np.any(about_origin):  # of a run without motions, whose centre is any
        return given.density_kg_m3, {}, given.mass_kg * (centre[2] - z_m)
    centre[2] = z_m
    inertia = given.mass_kg * (
        about_origin * np.abs(about_origin)
        - (centre @ centre * np.eye(3) - np.outer(centre, centre))
    )
    body = {"mass_kg": given.mass_kg, "gravity_centre_m": centre + origin, "inertia_kg_m2": inertia}
    return given.density_kg_m3, body, 0.0


def _place(path: Path) -> tuple[list[float], float]:
    """Return the body's origin in global axes, and the depth, of the ``.pot``."""
    if (found := parts.sibling(path, ".pot")) is None:
        return [0.0, 0.0, 0.0], np.inf
    lines = parts.text(found).splitlines()
    names = [n for n, line in enumerate(lines) if n and ".gdf" in line.lower()]
    if names:  # IALTPOT 2: depth in line 2, XBODY after the body's file
        depth, place = parts.floats(lines[1])[0], parts.floats(lines[names[0] + 1])[:4]
    else:
        row = next(numbers for line in lines[1:] if len(numbers := parts.floats(line)) >= 5)
        depth, place = row[0], row[1:5]
    if place[3] != 0:
        raise ValueError(f"{found}: the body is turned by {place[3]:g} degrees (XBODY): use 0")
    return place[:3], depth if depth > 0 else np.inf
