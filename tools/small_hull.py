"""Compute the small hull of the tests with Capytaine.

``python -m tools.small_hull FILE`` writes a netCDF file: a Wigley hull (parabolic waterlines and
sections) of 60 x 12 m with 4 m draught, at rest in deep water, its centre of gravity in the
waterline (GM 1.6 m). The radii of gyration are 0.38 of the breadth and a quarter of the length. The
frequencies end below the first irregular one.
"""

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray

SIZE_M: Final = (60.0, 12.0, 4.0)
PANELS: Final = (30, 10)
DENSITY_KG_M3: Final = 1025.0
OMEGA_RAD_S: Final = (*np.linspace(0.2, 1.8, 21), np.inf)


def main(path: Path) -> None:
    """Write the file."""
    import capytaine as cpt
    import xarray as xr
    from capytaine.io.xarray import separate_complex_values

    length, breadth, _ = SIZE_M
    hull = cpt.FloatingBody(
        mesh=cpt.Mesh(*_panels()),
        dofs=cpt.rigid_body_dofs(rotation_center=(0, 0, 0)),
        center_of_mass=(0, 0, 0),
        name="wigley",
    )
    mass = DENSITY_KG_M3 * hull.volume
    gyration = np.array([0.38 * breadth, 0.25 * length, 0.25 * length])
    inertia = np.diag([*[mass] * 3, *(mass * gyration**2)])
    hull.inertia_matrix = hull.add_dofs_labels_to_matrix(inertia)
    hull.hydrostatic_stiffness = hull.compute_hydrostatic_stiffness(rho=DENSITY_KG_M3)
    cases = xr.Dataset(
        coords={
            "omega": list(OMEGA_RAD_S),
            "wave_direction": np.radians(np.linspace(0, 180, 7)),
            "radiating_dof": list(hull.dofs),
            "rho": [DENSITY_KG_M3],
            "water_depth": [np.inf],
        }
    )
    found: Any = cpt.BEMSolver().fill_dataset(cases, [hull])
    for name in ("radiating_dof", "influenced_dof"):
        found[name] = found[name].astype(str)
    texts = [name for name in found.coords if str(found[name].dtype) in ("object", "category")]
    parts = ["Froude_Krylov_force", "diffraction_force"]
    kept = separate_complex_values(found.drop_vars(texts + parts))
    kept.to_netcdf(path)


def _panels() -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Vertices (n, 3) and panels (m, 4) of both sides, normals outward."""
    length, breadth, draught = SIZE_M
    along, down = np.linspace(-0.5, 0.5, PANELS[0] + 1), np.linspace(0.0, 1.0, PANELS[1] + 1)
    x, z = np.meshgrid(along, down, indexing="ij")
    y = breadth / 2 * (1 - (2 * x) ** 2) * (1 - z**2)
    row = PANELS[1] + 1
    first = (row * np.arange(PANELS[0])[:, None] + np.arange(PANELS[1])).ravel()
    port = np.column_stack([first, first + row, first + row + 1, first + 1])
    vertices = np.concatenate(
        [np.stack([length * x, side * y, -draught * z], axis=-1).reshape(-1, 3) for side in (1, -1)]
    )
    return vertices, np.concatenate([port, port[:, ::-1] + x.size])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
