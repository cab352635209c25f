"""Wetted port side of a hull, from a file of panels or from main particulars.

x forward, y to port, z up, the waterline at z = 0, normals into the water. A hull is the same on
both sides, so one side is kept: a quarter of the work.

The form of main particulars has superellipses as sections, ``(y / b)^p + (z / T)^p = 1`` of area
``2 b T G(1 + 1/p)^2 / G(1 + 2/p)``, G the gamma function, and the draught T all along. With x
from -1 to 1 along the ship, the half breadth b is ``B/2 (1 - |x|^n)`` and the coefficient of the
section's area falls from the midship one as ``Cm (1 - a x^2)``; n and a give the coefficients of
waterline and block.
"""

import io
import math
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.special import gamma

from utank_hil.base.arrays import FloatArray
from utank_hil.base.text_files import open_content, where_instead
from utank_hil.dynamics.roll_damping import HullForm

Panels = npt.NDArray[np.int64]

FORMATS: Final = "WAMIT .gdf, HAMS .pnl, NEMOH .mar, HydroStar .hst, .stl, .obj, .ply"
_BY_MESHIO: Final = (".stl", ".obj", ".ply")
_KNOWN: Final = (".gdf", ".pnl", ".mar", ".hst", *_BY_MESHIO)
_LENGTHS_M: Final = (3.0, 600.0)  #: Lengths of hulls: a model's, and more than the longest ship's.
_UNITS: Final = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048, "km": 1e3}
_TOLERANCE: Final = 1e-5  #: Distance per length up to which points are one, or lie in a plane.
_UNEQUAL: Final = 0.01  #: Greatest difference of the two sides, as a share.
_LIMIT_BYTES: Final = 1 << 27
_MOST_PANELS: Final = 3000  #: Of one side: matrices of 150 MB each.
_FORM_PANELS: Final = (36, 8)  #: Along and around.


class MeshError(ValueError):
    """The mesh is not a hull's, or not in the place or unit that is asked for."""


def read_mesh(
    path: Path, draught_m: float | None = None, trim_deg: float = 0.0, scale: float = 1.0
) -> tuple[Any, list[str]]:
    """Return the wetted port side as a mesh of Capytaine, and what was done to it.

    Parameters
    ----------
    draught_m : float, optional
        Depth of the lowest point; without it the waterline is at z = 0 of the file.
    trim_deg : float
        Bow down, about midship.
    scale : float
        Length of the file's unit in m.

    Raises MeshError if it can't be read, or is not a ship's hull, whole or half.
    """
    import capytaine as cpt

    cpt.set_logging("ERROR")  # its checks of single panels say less than ours
    if not path.is_file():
        absent = f"there is no such file; {where_instead(path)}"
        raise MeshError("is a folder" if path.is_dir() else absent)
    kind = path.suffix.lower()
    if kind in _BY_MESHIO and find_spec("meshio") is None:
        raise MeshError(f"{kind} needs meshio: pip install 'utank-hil[hulls]'")
    if kind not in _KNOWN:
        raise MeshError(f"can't be read as panels by its name; known are {FORMATS}")
    try:
        with open_content(path, _LIMIT_BYTES) as content:
            source: Any = io.StringIO(content.read().decode("latin-1"))
        if kind in _BY_MESHIO:  # they may be binary, and meshio asks the file for its size
            source = str(path)
        with warnings.catch_warnings(action="ignore"):  # of numpy on a file without panels
            mesh = cpt.load_mesh(source, file_format=kind).merged()
    except MemoryError:
        raise
    except Exception as error:  # whatever the formats' readers raise
        why = " ".join(str(error).split()) or type(error).__name__
        higher = "; WAMIT's higher-order panels (IGDEF) are none" if kind == ".gdf" else ""
        raise MeshError(f"can't be read as panels: {why}; known are {FORMATS}{higher}") from error
    points = mesh.vertices * scale
    _refuse_size(points)
    midship_m = (points[:, 0].min() + points[:, 0].max()) / 2
    turned = cpt.Mesh(points, mesh.faces, auto_check=False).translated_x(-midship_m)
    turned = turned.rotated_y(math.radians(trim_deg)).translated_x(midship_m)
    if draught_m is not None:
        height_m = float(np.ptp(turned.vertices[:, 2]))
        if draught_m > height_m:
            raise MeshError(f"is {height_m:.4g} m high, and the draught {draught_m:g} m: check both"
                            " units, --draught is in metres")  # fmt: skip
        turned = turned.translated_z(-float(turned.vertices[:, 2].min()) - draught_m)
    return _wetted(turned)


def _refuse_size(points_m: FloatArray) -> None:
    """Refuse points that are no numbers, a wrong unit, or a ship across the x axis."""
    if len(points_m) < 3 or not np.isfinite(points_m).all():
        raise MeshError("has no panels, or points that are no numbers")
    length, breadth = np.ptp(points_m, axis=0)[:2]
    least, most = _LENGTHS_M
    if not least <= length <= most:
        fitting = [f"--scale {of:g} if it is in {unit}" for unit, of in _UNITS.items()
                   if 10 <= length * of <= 500]  # fmt: skip
        raise MeshError(
            f"is {length:g} m long, hulls are {least:g} to {most:g}: "
            + (", ".join(fitting) or "give --scale, the length of its unit in m")
        )
    if breadth > length:
        raise MeshError(f"is {length:.4g} m along x and {breadth:.4g} m along y: x points forward")


def _wetted(mesh: Any) -> tuple[Any, list[str]]:
    import capytaine as cpt

    notes = []
    lowest, highest = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    near = _TOLERANCE * float(np.ptp(mesh.vertices[:, 0]))
    if lowest >= -near:
        raise MeshError(f"lies above the water, from z {lowest:.4g} m up: give --draught")
    if highest < -near:
        raise MeshError(f"lies wholly below the water, up to z {highest:.4g} m: give --draught")
    wet = _cut(mesh, 2, near)
    side, whole_m3 = wet.vertices[:, 1], abs(wet.volume)
    is_whole = side.min() < -near and side.max() > near
    if is_whole:
        wet = _cut(wet, 1, near)
    if wet.vertices[:, 1].max() <= near:
        wet = wet.mirrored("xOz")
    points, panels = _joined(wet.vertices, wet.faces, near)
    _refuse_panels(points, panels, near)
    closed = cpt.Mesh(points, panels, auto_check=False)
    side_m3 = abs(closed.volume)
    if is_whole and abs(2 * side_m3 - whole_m3) > _UNEQUAL * whole_m3:
        raise MeshError(
            f"displaces {side_m3:.4g} m3 to starboard of {whole_m3:.4g}: it must be whole, upright "
            "and the same on both sides of y = 0, its normals all outward"
        )
    if closed.volume < 0:
        notes.append("normals pointed into the hull: turned")
        closed = cpt.Mesh(points, panels[:, ::-1], auto_check=False)
    return closed, notes


def _cut(mesh: Any, axis: int, near_m: float) -> Any:
    """Return what lies at negative coordinates of an axis; cutting panels is slow."""
    import capytaine as cpt

    at = mesh.vertices[mesh.faces][..., axis]
    if np.any((at.min(axis=1) < -near_m) & (at.max(axis=1) > near_m)):
        return mesh.clipped(origin=(0, 0, 0), normal=np.eye(3)[axis])
    return cpt.Mesh(mesh.vertices, mesh.faces[at.min(axis=1) < -near_m], auto_check=False)


def _joined(points: FloatArray, panels: Panels, near_m: float) -> tuple[FloatArray, Panels]:
    """Return points that lie together as one, and panels without those that are lines."""
    from scipy.spatial import cKDTree

    points = points.copy()
    for axis in (1, 2):  # the two planes in which the side may be open
        points[np.abs(points[:, axis]) < near_m, axis] = 0.0
    first = np.arange(len(points))
    for one, other in sorted(cKDTree(points).query_pairs(near_m)):
        first[other] = min(first[other], first[one])
    panels = first[panels]
    corners = np.array([len(set(panel)) for panel in panels.tolist()])
    corner = points[panels]  # what lies in the two planes is a deck or the end of a stem
    outside = (corner[..., 1].max(axis=1) > 0.0) & (corner[..., 2].min(axis=1) < 0.0)
    return points, panels[(corners >= 3) & outside]


def _refuse_panels(points: FloatArray, panels: Panels, near_m: float) -> None:
    """Refuse sides that are open, doubled, turned against each other, or of too many panels."""
    if len(panels) > _MOST_PANELS:
        raise MeshError(f"has {len(panels)} panels a side, at most {_MOST_PANELS}: make it coarser")
    edges = np.stack([panels, np.roll(panels, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges = edges[edges[:, 0] != edges[:, 1]]
    both = np.sort(edges, axis=1)
    found, count = np.unique(both, axis=0, return_counts=True)
    ends = points[found]
    in_plane = np.any(np.all(np.abs(ends[..., 1:]) <= near_m, axis=1), axis=-1)

    def refuse(wrong: npt.NDArray[np.bool_], of: Panels, what: str, remedy: str) -> None:
        if np.any(wrong):
            x, y, z = points[of[wrong][0]].mean(axis=0)
            raise MeshError(f"{what} at {np.sum(wrong)} edges, one near x {x:.4g}, y {y:.4g}, "
                            f"z {z:.4g} m: {remedy}")  # fmt: skip

    refuse(count > 2, found, "has more than two panels", "take out inner walls and doubled panels")
    refuse(
        (count == 1) & ~in_plane,
        found,
        "is open",
        "close it, join its points, or have it reach above the waterline",
    )
    ways, twice = np.unique(edges, axis=0, return_counts=True)
    refuse(twice > 1, ways, "has neighbours with opposite normals", "make all normals point out")


def form_mesh(form: HullForm) -> Any:
    """Return the port side of a hull of main particulars as a mesh of Capytaine."""
    import capytaine as cpt

    along, around = _FORM_PANELS
    x = np.sin(np.linspace(-math.pi / 2, math.pi / 2, along + 1))
    n, fall = _form_numbers(form)
    half_m = form.beam_m / 2 * (1 - np.abs(x) ** n)
    power = np.array([_power(form.midship_coefficient * (1 - fall * at**2)) for at in x])
    points = []
    for at, half, p in zip(x, half_m, power, strict=True):
        turn = np.linspace(0, math.pi / 2, 400)
        y, z = half * np.cos(turn) ** (2 / p), -form.draught_m * np.sin(turn) ** (2 / p)
        run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
        to = np.linspace(0, run[-1], around + 1)
        rows = [np.full(around + 1, at * form.length_m / 2), np.interp(to, run, y),
                np.interp(to, run, z)]  # fmt: skip
        points.append(np.stack(rows, axis=-1))
    row = around + 1
    first = (row * np.arange(along)[:, None] + np.arange(around)).ravel()
    panels = np.column_stack([first, first + row, first + row + 1, first + 1])
    return cpt.Mesh(np.concatenate(points), panels, auto_check=False)


def _form_numbers(form: HullForm) -> tuple[float, float]:
    prismatic = form.block_coefficient / form.midship_coefficient
    waterline = min((1 + 2 * form.block_coefficient) / 3, 0.99)  # Schneekluth and Bertram 1998
    n = waterline / (1 - waterline)
    fall = min(max(3 * (n + 3) / n * (waterline - prismatic), 0.0), 0.8)
    powers = np.geomspace(0.5, 500.0, 1000)  # within these bounds the block decides
    blocks = powers / (powers + 1) - fall * powers / (3 * (powers + 3))
    return float(np.interp(prismatic, blocks, powers)), fall


def _power(area: float) -> float:
    """Return the superellipse whose area is this share of its rectangle."""
    powers = np.geomspace(0.4, 60.0, 400)
    areas = gamma(1 + 1 / powers) ** 2 / gamma(1 + 2 / powers)
    return float(np.interp(area, areas, powers))
