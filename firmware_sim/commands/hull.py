"""``utank-hil hull``: hydrodynamic data of a hull from its mesh."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from utank_hil.console import common
from utank_hil.console.common import argument, fail, option
from utank_hil.console.terminal import Terminal, notes, rows_table, say_note, shown

if TYPE_CHECKING:
    from utank_hil.dynamics.hull.hull_data import HullData

_POSITIVE = {"min": 1e-6, "max": 1e9}


def hull(
    mesh: Annotated[
        Path,
        argument(
            "Panels of the hull, x forward, z up: WAMIT .gdf, HAMS .pnl, NEMOH .mar, "
            "HydroStar .hst, .stl, .obj, .ply. Whole, or one side of y = 0."
        ),
    ],
    out: Annotated[Path, option("The netCDF file to write.", metavar="FILE")] = Path("hull.nc"),
    gm: Annotated[float | None, option("Metacentric height, m; or --gravity.", **_POSITIVE)] = None,
    gravity: Annotated[float | None, option("Centre of gravity above the waterline, m.")] = None,
    roll_period: Annotated[
        float | None, option("Of the free roll, s; or --gyration.", **_POSITIVE)
    ] = None,
    gyration: Annotated[float | None, option("Radius of gyration in roll, m.", **_POSITIVE)] = None,
    draught: Annotated[
        float | None,
        option(
            "Depth of the lowest point, m.",
            default="the waterline is z = 0 of the file",
            **_POSITIVE,
        ),
    ] = None,
    trim: Annotated[float, option("Bow down, about midship, degrees.", min=-20, max=20)] = 0.0,
    scale: Annotated[float, option("Unit of the file in m, 0.001 for mm.", **_POSITIVE)] = 1.0,
    displacement: Annotated[
        float | None, option("In t, to check that of the mesh.", **_POSITIVE)
    ] = None,
    density: Annotated[float, option("Of the water, kg/m3.", min=900, max=1100)] = 1025.0,
    json_: common.Json = False,
) -> None:
    """Compute what waves do to a hull, for `ship: {hull: FILE}`.

    Added mass, damping and wave forces of the ship at rest in deep water, by Capytaine (a package
    of the extra `hulls`). The ship's speed enters a scenario by the frequency of encounter.

    **Example:** utank-hil hull supply.gdf --draught 6 --gm 1.2 --roll-period 10 --out supply.nc
    """
    import capytaine  # noqa: F401, its absence is said before the work

    from firmware_sim.hull.compute import Loading, compute_hull, write_hull
    from firmware_sim.hull.mesh import read_mesh

    for one, other, names in (
        (gm, gravity, "--gm or --gravity"),
        (roll_period, gyration, "--roll-period or --gyration"),
    ):
        if (one is None) == (other is None):
            fail(f"{names} is needed, and not both")
    if out.suffix.lower() != ".nc":
        fail(f"--out {out}: its suffix must be .nc")
    common.require_writable(out, "--out")
    loading = Loading(gm, gravity, roll_period, gyration, displacement, density)
    with common.failing(ValueError, at=mesh):
        side, said = read_mesh(mesh, draught, trim, scale)
        with notes.busy(f"{shown(mesh)}: {2 * side.nb_faces} panels, computing"):
            data, found, wrong = compute_hull(side, loading, str(out))
        figures = hull_figures(found)
    for text in (*said, *wrong):
        say_note(f"{mesh}: {text}")
    write_hull(out, data)
    length_m, half_m, draught_m = map(float, np.ptp(side.vertices, axis=0))
    sizes = {"length_m": length_m, "beam_m": 2 * half_m, "draught_m": draught_m}  # below water
    figures = sizes | figures
    if json_:
        common.print_json({"file": str(out), "panels": 2 * side.nb_faces, **figures})
        return
    rows = (
        (words.replace("_", " "), f"{value:.4g} {unit.replace('ratio', '')}")
        for name, value in figures.items()
        for words, _, unit in (name.rpartition("_"),)
    )
    console = Terminal()
    console.table(rows_table(shown(mesh), rows))
    console.say(f"written: {shown(out)}; in a ship's file ship: {{hull: {shown(out)}}}")


def hull_figures(hull: "HullData") -> dict[str, float]:
    """Figures by which a naval architect knows the ship again."""
    from utank_hil.dynamics.hull.hull_data import free_roll
    from utank_hil.dynamics.hull.lateral import LateralHull

    free = free_roll(hull)
    about_g: Any = hull.about_gravity_centre()
    mass_kg, weight_n = about_g.mass_kg, about_g.mass_kg * hull.gravity_m_s2
    return {
        "displacement_t": mass_kg / 1e3,
        "metacentric_height_m": about_g.hydrostatic[3, 3] / weight_n,
        "centre_of_gravity_above_water_m": hull.known("gravity_centre_m")[2],
        "roll_period_s": free.period_s,
        "roll_gyration_m": math.sqrt(about_g.inertia_kg_m2[0, 0] / mass_kg),
        "damping_by_radiated_waves_ratio": free.radiation_ratio,
        "radiation_memory_error_ratio": max(LateralHull(hull).memory_errors(six=True).values()),
        "shortest_wave_s": 2 * math.pi / hull.wave_frequency_rad_s[-1],
        "longest_wave_s": 2 * math.pi / hull.wave_frequency_rad_s[0],
    }
