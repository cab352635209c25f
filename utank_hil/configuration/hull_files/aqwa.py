"""AQWA: the ``.AH1`` that AQWA-LINE writes.

Everything refers to the centre of gravity; the phase is a lag over the wave's crest at that place.
"""

from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.configuration.hull_files import parts
from utank_hil.dynamics.hull.hull_data import HullData, wave_number


def read_aqwa(path: Path, given: parts.Given) -> HullData:  # noqa: ARG001, the same for all readers
    """Read an ``.AH1``."""
    blocks = _blocks(path)
    head = [number for row in blocks[""] for number in row]
    bodies, directions, count = (int(each) for each in head[:3])
    if bodies != 1:
        raise ValueError(f"{path}: has {bodies} bodies: one hull is wanted")
    heading, keep = np.unique(
        parts.half_turn(np.array(head[3 : 3 + directions])), return_index=True
    )
    omega = np.array(head[3 + directions : 3 + directions + count])
    for name in ("GENERAL", "COG", "MASS", "HYDSTIFFNESS", "ADDEDMASS", "DAMPING", "FORCERAO"):
        if name not in blocks:
            raise ValueError(f"{path}: the block {name} is missing")
    general = blocks["GENERAL"][0]
    # before version 18.2 the row has no number of the body in front
    depth, density, gravity = general[1:4] if len(general) >= 6 else general[:3]
    centre = np.array(blocks["COG"][0][1:4])
    force = np.array(blocks["FORCERAO"], dtype=object).reshape(directions, count, 2)
    size = np.array([[row[3:9] for row in each] for each in force[..., 0]], dtype=np.float64)
    lag = np.array(force[..., 1].tolist(), dtype=np.float64)[..., -6:]
    excitation = size[keep] * np.exp(-1j * np.radians(lag[keep]))
    k = wave_number(omega, depth, gravity)
    body: dict[str, Any] = parts.rigid_body(_matrix(blocks["MASS"], 1))
    body["gravity_centre_m"] = centre
    viscous = blocks["FIDD"][0][4] if "FIDD" in blocks else 0.0
    notes = [
        "" if "inertia_kg_m2" in body else "MASS holds the mass on its whole diagonal, no inertia",
        "ADDEDMASS_HF is of 100 rad/s, not the limit: left out" if "ADDEDMASS_HF" in blocks else "",
        "" if viscous else "roll damping is that of waves alone: add the viscous part",
    ]
    return parts.hull_of(
        path,
        notes,
        frequency_rad_s=omega,
        added_mass=_matrices(blocks["ADDEDMASS"], count),
        damping=_matrices(blocks["DAMPING"], count),
        wave_frequency_rad_s=omega,
        heading_deg=heading,
        excitation=excitation * parts.phase_at(centre, heading, k),
        hydrostatic=_matrix(blocks["HYDSTIFFNESS"], 1),
        viscous_roll_nms_rad=np.full(count, viscous) if viscous else None,
        reference_m=centre,
        density_kg_m3=density,
        gravity_m_s2=gravity,
        water_depth_m=depth,
        **body,
    )


def _blocks(path: Path) -> dict[str, list[list[float]]]:
    """Return the rows of numbers by their key word; those before the first by an empty one."""
    blocks: dict[str, list[list[float]]] = {}
    name = ""
    for line in parts.text(path).splitlines():
        if line.startswith("*"):
            continue
        if row := parts.floats(line):
            blocks.setdefault(name, []).append(row)
        elif line.strip():
            name = line.split()[0].upper()
            if name in blocks:
                raise ValueError(
                    f"{path}: has the block {name} twice: which one holds is not clear"
                )
    if "" not in blocks:
        raise ValueError(f"{path}: has no heading of bodies, directions and frequencies")
    return blocks


def _matrix(rows: list[list[float]], before: int) -> FloatArray:
    """Return a matrix of six rows, the first of which has some numbers before it."""
    return np.array([rows[0][before:], *rows[1:6]])


def _matrices(rows: list[list[float]], count: int) -> FloatArray:
    """Return a matrix a frequency; body, body and frequency stand before each first row."""
    return np.array([_matrix(rows[6 * n : 6 * n + 6], 3) for n in range(count)])
