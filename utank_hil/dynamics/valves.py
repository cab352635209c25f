"""Valve losses of a semi-active tank: a throttle in the duct or in the air pipe.

Both losses are quadratic in the flow speed, so the models take one number, the pressure loss per
``|dh/dt| dh/dt``. The air is treated as incompressible, which holds while the pressure across its
valve is well below atmospheric. A closed valve (an air spring, or a locked tank) is not modelled.
"""

from utank_hil.dynamics.tank import Tank

AIR_DENSITY_KG_M3 = 1.225


def duct_valve_loss(tank: Tank, opening: float) -> float:
    """Loss coefficient of a gate in the duct, by the Borda-Carnot law (1 / s - 1)^2.

    Parameters
    ----------
    tank : Tank
    opening : float
        Open fraction s of the duct's area, above 0 and up to 1.

    Returns
    -------
    float
        Pa per (m/s)^2 of dh/dt, in addition to the tank's quadratic loss.

    Raises
    ------
    ValueError
        If the opening is out of range.
    """
    _check_opening(opening)
    area_ratio = tank.reservoir_area_m2 / tank.duct_area_m2
    return tank.density_kg_m3 / 2 * ((1 / opening - 1) * area_ratio) ** 2


def air_valve_loss(
    tank: Tank, pipe_area_m2: float, opening: float, discharge_coefficient: float = 0.6
) -> float:
    """Loss coefficient of an orifice in the air pipe between the reservoirs.

    Parameters
    ----------
    tank : Tank
    pipe_area_m2 : float
        Area of the pipe with its valve fully open.
    opening : float
        Open fraction of that area, above 0 and up to 1.
    discharge_coefficient : float
        Contraction of the jet; 0.6 for a sharp edge.

    Returns
    -------
    float
        Pa per (m/s)^2 of dh/dt, in addition to the tank's quadratic loss.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    _check_opening(opening)
    for name, value in (
        ("pipe_area_m2", pipe_area_m2),
        ("discharge_coefficient", discharge_coefficient),
    ):
        if not value > 0:
            raise ValueError(f"air valve {name} must be positive, got {value}")
    jet_area = discharge_coefficient * opening * pipe_area_m2
    return AIR_DENSITY_KG_M3 / 2 * (tank.reservoir_area_m2 / jet_area) ** 2


def _check_opening(opening: float) -> None:
    if not 0 < opening <= 1:
        raise ValueError(f"valve opening must be above 0 and at most 1, got {opening}")
