"""NEMOH 2 and 3: ``Nemoh.cal`` and the tables beside it or one folder below.

Forces are conjugated, because NEMOH's time goes as exp(-i w t). Rotations and moments refer to the
point written at each degree, phases to XEFF, YEFF. ``KH.dat`` has the weight's part in it, of the
centre of gravity in ``Hydrostatics.dat``.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.configuration.hull_files.parts import Given, floats, hull_of, table, text
from utank_hil.dynamics.hull.hull_data import HullData


def read_nemoh(path: Path, given: Given) -> HullData:  # noqa: ARG001, the same for all readers
    """Read a ``Nemoh.cal`` with its results."""
    lines = [line.split("!")[0] for line in text(path).splitlines() if not line.startswith("---")]
    density, gravity, depth = (floats(line)[0] for line in lines[:3])
    start = floats(lines[3])[:2]
    if floats(lines[4])[0] != 1:
        raise ValueError(f"{path}: has several bodies: one hull is wanted")
    counts = int(floats(lines[7])[0])
    degrees = [floats(line)[:7] for line in lines[8 : 8 + counts]]
    forces = [floats(line)[:7] for line in lines[9 + counts : 9 + counts + len(degrees)]]
    if degrees != forces or [row[:4] for row in degrees] != _SIX:
        raise ValueError(f"{path}: must have the six degrees from surge to yaw, and their forces")
    points = {tuple(row[4:]) for row in degrees[3:]}
    if len(points) > 1:
        raise ValueError(f"{path}: roll, pitch and yaw turn about different points: use one")
    origin = np.array([*start, 0.0])

    radiation = _zones(_find(path, "RadiationCoefficients.tec"))
    omega = radiation[0][1][:, 0]
    # a zone holds one moving degree; its columns are the forces
    pairs = np.array([zone[:, 1:13].reshape(-1, 6, 2) for _, zone in radiation])
    waves = _zones(_find(path, "ExcitationForce.tec"))
    titles = [_BETA.search(title) for title, _ in waves]
    heading = np.array([float(found.group(1)) for found in titles if found])
    if len(heading) != len(waves):
        raise ValueError(f"{path}: ExcitationForce.tec has a zone whose title has no beta")
    order = np.argsort(heading)
    polar = np.array([zone[:, 1:13].reshape(-1, 6, 2) for _, zone in waves])[order]
    return hull_of(
        path,
        ["roll damping is that of waves alone: add the viscous part"],
        frequency_rad_s=omega,
        added_mass=pairs[..., 0].transpose(1, 2, 0),
        damping=pairs[..., 1].transpose(1, 2, 0),
        wave_frequency_rad_s=waves[0][1][:, 0],
        heading_deg=heading[order],
        excitation=polar[..., 0] * np.exp(-1j * polar[..., 1]),
        reference_m=np.array(points.pop()) - origin,
        density_kg_m3=density,
        gravity_m_s2=gravity,
        water_depth_m=depth if depth > 0 else np.inf,
        **_hydrostatics(path, density, origin),
    )


_SIX = [
    [1, 1, 0, 0], [1, 0, 1, 0], [1, 0, 0, 1], [2, 1, 0, 0], [2, 0, 1, 0], [2, 0, 0, 1],
]  # fmt: skip
_BETA = re.compile(r"beta\s*=\s*(\S+)", re.IGNORECASE)


def _find(path: Path, name: str) -> Path:
    found = [*path.parent.glob(name), *sorted(path.parent.glob(f"*/{name}"))]
    if len(found) != 1:
        many = f"are in {len(found)} folders" if found else "is missing"
        raise ValueError(f"{path}: {name} {many}: one is wanted beside it or one folder below")
    return found[0]


def _zones(path: Path) -> list[tuple[str, FloatArray]]:
    """Return titles and rows of the zones of a table of Tecplot."""
    head, *parts = re.split(r"(?im)^\s*zone\b", text(path))
    if "rad/s" not in head:
        raise ValueError(f"{path}: the first column must be w (rad/s), not Hz or s")
    zones = []
    for part in parts:
        title, *lines = part.splitlines()
        rows = [row for line in lines if (row := floats(line))]
        if len(set(map(len, rows))) != 1 or not np.isfinite(rows).all():
            raise ValueError(
                f"{path}: its zone{title} has rows of different lengths, or no finite numbers"
            )
        zones.append((title, np.array(rows)))
    if len({zone.shape for _, zone in zones}) != 1:
        raise ValueError(f"{path}: holds no zones of numbers, or zones of different sizes")
    return zones


def _hydrostatics(path: Path, density: float, origin: FloatArray) -> dict[str, Any]:
    """Return restoring matrix, mass and centre of gravity, as far as the files are there."""
    stiff = [*path.parent.glob("KH.dat"), *path.parent.glob("*/KH.dat")]
    words = [*path.parent.glob("Hydrostatics.dat"), *path.parent.glob("*/Hydrostatics.dat")]
    found: dict[str, Any] = {}
    if stiff:
        found["hydrostatic"] = np.array(table(stiff[0], 6))[:6, :6]
    if words:
        lines = text(words[0])
        centre = [float(each) for each in re.findall(r"[XYZ]G\s*=\s*(\S+)", lines)]
        volume = re.search(r"Displacement\s*=\s*(\S+)", lines)
        if len(centre) != 3 or volume is None:
            raise ValueError(f"{words[0]}: must hold XG, YG, ZG and Displacement")
        found["mass_kg"] = density * float(volume.group(1))
        found["gravity_centre_m"] = np.array(centre) - origin
    return found
