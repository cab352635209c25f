"""Hydrodynamic data of a hull by Capytaine, as the netCDF file that ``ship.hull`` reads.

The ship is at rest in deep water: its speed enters by the frequency of encounter. A lid in the
waterline keeps irregular frequencies away. What is left of them shows in the energy: with the
force X per metre of a deep-water wave to the direction b, damping is (Haskind) ::

    B = k w / (4 pi rho g^2) * integral of |X(b)|^2 over all b

Frequencies at which that fails in sway, heave or roll are left out and named.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.hull.mesh import MeshError, form_mesh
from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import left_whole
from utank_hil.configuration.hull_files.capytaine import GIVEN, hull_of_dataset
from utank_hil.dynamics.hull.hull_data import (
    HullData,
    UncoveredError,
    free_roll,
    with_roll_period,
)
from utank_hil.dynamics.hull.lateral import LateralHull
from utank_hil.dynamics.roll_damping import HullForm
from utank_hil.dynamics.tank import GRAVITY_M_S2

_OMEGA: Final = np.linspace(0.2, 2.5, 30)
"""Frequencies times sqrt(beam / g): waves from 150 beams to one."""
_LEAST_TOP: Final = 1.5  #: Of them, for the roll of any ship and what radiates from it.
_HEADINGS_RAD: Final = np.radians(np.linspace(0.0, 180.0, 19))
_PANELS_A_WAVE: Final = 8
_ENERGY_ERROR: Final = 0.1
"""Greatest difference of the two sides of Haskind's relation; coarse meshes have 3 %."""
_SAME_MASS: Final = 0.03  #: Relative difference of displacements that are the same.
_GYRATION_PER_BEAM: Final = (0.2, 0.8)  #: Plausible in roll; usual ships have about 0.4.
_GYRATION: Final = 0.25  #: Radius of gyration in pitch and yaw per length.


@dataclass(frozen=True, slots=True)
class Loading:
    """Mass of a ship at its waterline: GM or centre of gravity, and roll period or gyration."""

    gm_m: float | None = None
    gravity_m: float | None = None  #: Centre of gravity above the waterline.
    roll_period_s: float | None = None  #: Of the free roll.
    gyration_m: float | None = None  #: Radius about the centre of gravity, in roll.
    displacement_t: float | None = None  #: By default that of the mesh.
    density_kg_m3: float = 1025.0


def compute_hull(
    side: Any, loading: Loading, name: str, omega_rad_s: FloatArray | None = None
) -> tuple[Any, HullData, list[str]]:
    """Return the dataset of a hull, what it means, and frequencies that had to be left out.

    `side` is the wetted port side as a mesh of Capytaine, see `mesh`; without frequencies they go
    from waves of 150 beams to what the panels can follow, one beam at least. MeshError is raised if
    its panels are too few, the frequencies around the roll had to be left out, or the loading does
    not belong to the hull.
    """
    import capytaine as cpt
    import xarray as xr
    from capytaine.io.xarray import separate_complex_values

    cpt.set_logging("ERROR")  # else what it skips at infinite frequency goes to standard output
    mesh = cpt.ReflectionSymmetricMesh(side, plane="xOz")
    lid, degrees = _lid(side), cpt.rigid_body_dofs(rotation_center=(0, 0, 0))
    hull = cpt.FloatingBody(mesh=mesh, lid_mesh=lid, dofs=degrees, name="hull")
    # One point a panel is as good as the panels for waves, not for the metacentre.
    still = cpt.FloatingBody(mesh=mesh.merged().with_quadrature("Gauss-Legendre 2"), dofs=degrees)
    omega = _frequencies(mesh) if omega_rad_s is None else omega_rad_s
    density = loading.density_kg_m3
    mass_kg, centre_m = density * float(still.volume), _gravity_centre(still, loading)
    still.center_of_mass = tuple(centre_m)
    length_m, beam_m = (float(np.ptp(mesh.vertices[:, axis])) for axis in (0, 1))
    _refuse_gyration(float(still.transversal_metacentric_height), loading, beam_m)
    cases = {
        "omega": [*omega, np.inf],
        "wave_direction": _HEADINGS_RAD,
        "radiating_dof": list(hull.dofs),
        "rho": [density],
        "g": [GRAVITY_M_S2],
        "water_depth": [np.inf],
    }
    data: Any = cpt.BEMSolver().fill_dataset(xr.Dataset(coords=cases), [hull], progress_bar=False)
    for axis in ("radiating_dof", "influenced_dof"):
        data[axis] = data[axis].astype(str)
    texts = [each for each in data.coords if str(data[each].dtype) in ("object", "category")]
    data = data.drop_vars([*texts, "Froude_Krylov_force", "diffraction_force"], errors="ignore")
    data = separate_complex_values(data)
    for each in ("added_mass", "radiation_damping"):  # alike but for the size of panels
        turned = data[each].transpose("omega", "influenced_dof", "radiating_dof").values
        data[each] = data[each].transpose("omega", "radiating_dof", "influenced_dof")
        data[each].values = (data[each].values + turned) / 2
    data["hydrostatic_stiffness"] = still.compute_hydrostatic_stiffness(rho=density, g=GRAVITY_M_S2)
    data["center_of_mass"] = ("point", centre_m)
    data["rotation_center"] = ("point", np.zeros(3))
    found = hull_of_dataset(Path(name), data)
    arm_m = -float(mesh.vertices[:, 2].min()) / 2  # of the water's pressure on the sides
    wrong = found.frequency_rad_s[np.max(energy_errors(found, arm_m), axis=1) > _ENERGY_ERROR]
    if len(omega) - len(wrong) < 2:
        raise MeshError("radiates other energy than it takes from waves: is it a ship's hull?")
    data = data.sel(omega=[at for at in data["omega"].values if at not in wrong])
    kept = hull_of_dataset(Path(name), data)
    gyration = np.array([loading.gyration_m or 0.4 * beam_m, *[_GYRATION * length_m] * 2])
    inertia = mass_kg * np.diag(gyration**2)
    body: Any = {"mass_kg": mass_kg, "gravity_centre_m": centre_m, "inertia_kg_m2": inertia}
    try:
        found = _rolling(replace(kept, **body), loading, wrong)
    except UncoveredError as error:
        _rolling(replace(found, **body), loading, wrong)  # not covered with what was lost either
        lost = ", ".join(f"{at:.3g}" for at in wrong)
        raise MeshError(
            f"{error.gap}: energy does not add up at {lost} rad/s, which are left out: take "
            "finer panels"
        ) from error
    axes = ("influenced_dof", "radiating_dof")
    data["inertia_matrix"] = xr.DataArray(found.mass_matrix, dims=axes, attrs={GIVEN: 1})
    said = [f"energy does not add up, irregular frequency or too coarse: {at:.3g} rad/s left out"
            for at in wrong]  # fmt: skip
    return data, found, said


def _rolling(hull: HullData, loading: Loading, lost: FloatArray) -> HullData:
    """Return the hull with the period of a loading; UncoveredError where the lost left a gap."""
    if loading.roll_period_s is not None:
        return with_roll_period(hull, loading.roll_period_s)
    if len(lost):
        free_roll(hull)
    return hull


def _refuse_gyration(gm_m: float, loading: Loading, beam_m: float) -> None:
    """Raise MeshError, before the long work, if period and GM are those of another beam."""
    gyration_m, by = loading.gyration_m, ""
    if loading.roll_period_s is not None:
        gyration_m = loading.roll_period_s / (2 * math.pi) * math.sqrt(GRAVITY_M_S2 * gm_m)
        by = f"with GM {gm_m:.3g} m and a roll period of {loading.roll_period_s:g} s "
    least, most = _GYRATION_PER_BEAM
    if gyration_m is not None and not least <= gyration_m / beam_m <= most:
        raise MeshError(
            f"{by}has a radius of gyration of {gyration_m:.3g} m on a beam of {beam_m:.3g} m; "
            "0.4 of it is usual: check GM, period or gyration, and --scale (0.3048 for feet)"
        )


def usual_hull(form: HullForm, loading: Loading) -> tuple[Any, LateralHull]:
    """Return the dataset of the usual form of main particulars, and the hull."""
    data, found, _ = compute_hull(form_mesh(form), loading, "hull of main particulars")
    return data, LateralHull(found)


def write_hull(path: Path, data: Any) -> None:
    """Write the dataset of a hull as netCDF."""
    with left_whole(path):
        data.to_netcdf(path, engine="h5netcdf")


def energy_errors(hull: HullData, arm_m: float = 0.0) -> FloatArray:
    """Return the relative error of Haskind's relation at each frequency, shape (n, 3).

    The degrees are sway, heave and roll; the headings go from 0 to 180 degrees. Where sides and
    bottom cancel each other in roll, its error is that of the moment of sway's force at `arm_m`.
    """
    degrees = [1, 2, 3]
    force = np.abs(hull.excitation[..., degrees]) ** 2
    around = 2 * np.trapezoid(force, np.radians(hull.heading_deg), axis=0)
    omega = hull.wave_frequency_rad_s[:, None]
    taken = omega**3 * around / (4 * math.pi * hull.density_kg_m3 * hull.gravity_m_s2**3)
    given = hull.damping[:, degrees, degrees]
    scale = np.maximum(given, 0.02 * given.max(axis=0))
    scale[:, 2] = np.maximum(scale[:, 2], given[:, 0] * arm_m**2)
    return np.asarray(np.abs(given - taken) / scale)


def _lid(side: Any) -> Any:
    """Return panels in the waterline, from its edges to the middle; Capytaine's have holes."""
    import capytaine as cpt

    at = side.vertices[side.faces]
    edges = np.stack([at, np.roll(at, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    edges = edges[np.all(edges[..., 2] == 0.0, axis=1) & (edges[:, 0, 0] != edges[:, 1, 0])]
    runs_m = np.abs(edges[:, 0, 0] - edges[:, 1, 0])
    if runs_m.sum() > 1.01 * np.ptp(side.vertices[:, 0]):  # several hulls, or a well
        return cpt.ReflectionSymmetricMesh(side, plane="xOz").generate_lid()
    panels = []
    for edge, run_m in zip(edges, runs_m, strict=True):
        count = max(1, math.ceil(edge[:, 1].mean() / max(run_m, edge[:, 1].max() / 10)))
        for inner, outer in zip(range(count), range(1, count + 1), strict=True):
            far, near = (1, outer / count, 0), (1, inner / count, 0)
            panels.append([edge[0] * far, edge[1] * far, edge[1] * near, edge[0] * near])
    half = cpt.Mesh.from_list_of_faces(panels, auto_check=False)
    return cpt.ReflectionSymmetricMesh(half, plane="xOz")


def _frequencies(mesh: Any) -> FloatArray:
    unit = math.sqrt(GRAVITY_M_S2 / float(np.ptp(mesh.vertices[:, 1])))
    largest_m = float(mesh.faces_radiuses.max())
    top = math.sqrt(2 * math.pi * GRAVITY_M_S2 / (_PANELS_A_WAVE * largest_m))
    if top < _LEAST_TOP * unit:
        wave_m = 2 * math.pi * GRAVITY_M_S2 / (_LEAST_TOP * unit) ** 2
        raise MeshError(
            f"has too few panels: the largest has a radius of {largest_m:.3g} m, and waves of "
            f"{wave_m:.3g} m ask for {wave_m / _PANELS_A_WAVE:.3g} m: divide them"
        )
    return np.asarray(_OMEGA[unit * _OMEGA <= top] * unit)


def _gravity_centre(hull: Any, loading: Loading) -> FloatArray:
    """Return the centre of gravity, above that of buoyancy; MeshError if the loading is another."""
    x, _, buoyancy_m = hull.center_of_buoyancy
    metacentre_m = buoyancy_m + float(hull.transversal_metacentric_radius)
    if loading.gm_m is not None:
        height_m = metacentre_m - loading.gm_m
    else:
        height_m = metacentre_m if loading.gravity_m is None else loading.gravity_m
        if height_m >= metacentre_m:
            raise MeshError(f"has its metacentre {metacentre_m:.3g} m above the waterline: the "
                            "centre of gravity must be below it")  # fmt: skip
    displaced_t = 1e-3 * loading.density_kg_m3 * float(hull.volume)
    given_t = loading.displacement_t or displaced_t
    if abs(displaced_t / given_t - 1) > _SAME_MASS:
        raise MeshError(
            f"displaces {displaced_t:.4g} t, and the ship has {given_t:.4g} t: check draught, "
            "trim, scale and displacement"
        )
    return np.array([x, 0.0, height_m])
