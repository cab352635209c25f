"""Capytaine: netCDF, of version 3 or 4 of that format.

Forces are conjugated, because Capytaine's time goes as exp(-i w t). Axes are taken by name: the
radiation matrices have the force's index last, the others first.
"""

from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.base.arrays import ComplexArray
from utank_hil.configuration.hull_files.parts import Given, hull_of, rigid_body
from utank_hil.dynamics.hull.hull_data import DEGREES, HullData
from utank_hil.sea.measured import open_netcdf

GIVEN = "mass_distribution_given"
"""Attribute of an inertia matrix that is the ship's, about the origin; others may be a solid's."""


def read_capytaine(path: Path, given: Given) -> HullData:  # noqa: ARG001, the same for all readers
    """Read a netCDF file."""
    try:
        with open_netcdf(path) as content:
            data = content.load()
    except ImportError as error:
        raise ValueError(f"{path} needs xarray: pip install 'utank-hil[files]'") from error
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} can't be read as netCDF: {error}") from error
    return hull_of_dataset(path, data)


def hull_of_dataset(path: Path, data: Any) -> HullData:
    """Return the hull of a dataset, by the name of its file."""
    needed = ("omega", "added_mass", "radiation_damping", "wave_direction")
    lacking = [name for name in needed if name not in data]
    if lacking:
        raise ValueError(f"{path}: {', '.join(lacking)} missing: is it a dataset of Capytaine?")
    for axis in ("radiating_dof", "influenced_dof"):
        names = [str(name).lower().rpartition("__")[2] for name in data[axis].values]
        if any(names.count(each) != 1 for each in DEGREES):
            raise ValueError(f"{path}: must have the degrees {', '.join(DEGREES)} of one body")
        data[axis] = names
    data = data.sel(radiating_dof=list(DEGREES), influenced_dof=list(DEGREES))
    speed = float(data["forward_speed"]) if "forward_speed" in data else 0.0
    if speed != 0:
        raise ValueError(
            f"{path}: computed at {speed:g} m/s, where coefficients depend on the heading: "
            "compute at rest; the ship's speed is taken by the frequency of encounter"
        )

    def matrix(name: str) -> Any:
        return data[name].transpose(..., "influenced_dof", "radiating_dof").values

    omega = data["omega"].values
    added, damping = matrix("added_mass"), matrix("radiation_damping")
    numbers = np.all(np.isfinite(added) & np.isfinite(damping), axis=(1, 2))
    proper = (omega > 0) & np.isfinite(omega)
    finite = proper & numbers
    limit = added[(omega == np.inf) & np.all(np.isfinite(added), axis=(1, 2))]
    excitation = _excitation(path, data)
    usable = finite & np.all(np.isfinite(excitation), axis=(0, 2))
    lost = int(np.sum(proper & ~usable))
    order = np.argsort(omega[usable])
    heading = np.degrees(data["wave_direction"].values)
    turn = np.argsort(heading)
    radiation = np.flatnonzero(finite)[np.argsort(omega[finite])]
    body, notes = _body(data, matrix)
    return hull_of(
        path,
        [
            *notes,
            f"{lost} frequencies hold what is no number: left out" if lost else "",
            "roll damping is that of waves alone: add the viscous part",
        ],
        frequency_rad_s=omega[radiation],
        added_mass=added[radiation],
        damping=damping[radiation],
        wave_frequency_rad_s=omega[usable][order],
        heading_deg=heading[turn],
        excitation=np.conj(excitation[turn][:, usable][:, order]),
        hydrostatic=matrix("hydrostatic_stiffness") if "hydrostatic_stiffness" in data else None,
        density_kg_m3=float(data["rho"]),
        gravity_m_s2=float(data["g"]),
        water_depth_m=float(data["water_depth"]),
        infinite_added_mass=limit[0] if len(limit) else None,
        **body,
    )


def _excitation(path: Path, data: Any) -> ComplexArray:
    """Return the force by heading, frequency and degree, in Capytaine's own time."""
    if "excitation_force" in data:
        force = data["excitation_force"]
    elif "Froude_Krylov_force" in data and "diffraction_force" in data:
        force = data["Froude_Krylov_force"] + data["diffraction_force"]
    else:
        raise ValueError(f"{path}: excitation_force is missing, or its two parts")
    if "complex" in force.dims:
        force = force.sel(complex="re") + 1j * force.sel(complex="im")
    return np.asarray(force.transpose("wave_direction", "omega", "influenced_dof").values)


def _body(data: Any, matrix: Any) -> tuple[dict[str, Any], list[str]]:
    """Return mass and points, as far as the file has them, and what it has not."""
    body: dict[str, Any] = {}
    notes = []
    if "inertia_matrix" in data and data["inertia_matrix"].attrs.get(GIVEN):
        body |= rigid_body(matrix("inertia_matrix"))
    elif "inertia_matrix" in data:
        body["mass_kg"] = float(matrix("inertia_matrix")[0, 0])
        notes.append("inertia_matrix may be that of a homogeneous body: only its mass is taken")
    if "center_of_mass" in data:
        body["gravity_centre_m"] = np.ravel(data["center_of_mass"].values)[:3]
    if "rotation_center" in data:
        body["reference_m"] = np.ravel(data["rotation_center"].values)[:3]
    else:
        notes.append("the point of the moments is not in the file: taken as the origin")
    return body, notes
