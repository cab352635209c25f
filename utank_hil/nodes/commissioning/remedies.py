"""What to do about scales that the pulses of a commissioning show to be wrong."""

from typing import Final, Generic, NamedTuple, TypeVar

from utank_hil.nodes.commissioning import precision

NO_PRESSURE: Final = 0.15
"""Of what was commanded: less is none."""
_T = TypeVar("_T")


class Each(NamedTuple, Generic[_T]):
    """Something for each signal."""

    pressure: _T
    port: _T
    starboard: _T
    roll: _T
    rate: _T


def remedies_of(scales: Each[float], of_derived: str = "") -> Each[str]:
    """What to do about each scale if it is wrong; all of them together say what is reversed.

    Of the signed `scales` 1 is right, and 0 did not move. `of_derived` is said of a rate that is
    derived of the roll: it has no sign and scale of its own.
    """
    pressure, port, starboard, roll, rate = scales
    if abs(pressure) < NO_PRESSURE:
        no_pump = "The pump gives no pressure, or its sensor shows none. Check both."
        return Each(no_pump, *["Without pressure nothing moves."] * 4)
    # whoever is compared with a wrong pressure shows the inverse of its scale
    sensor = abs(pressure - 1) > precision.SCALE and all(
        abs(pressure * gauge - 1) <= 2 * precision.SCALE for gauge in (port, starboard)
    )
    if sensor:
        of_pressure = (
            "The pressure sensor is connected the wrong way round: exchange its sides."
            if pressure < 0
            else "The water moves by what was commanded: correct the pressure sensor's scaling."
        )
    elif pressure < 0:
        of_pressure = (
            "The pump pushes to port when it is to push to starboard: exchange two of the motor's "
            "phases, or correct the drive's direction."
        )
    else:
        of_pressure = "Check the pump for blockage, and the drive's limits and scaling."
    agrees = "It agrees once the pressure sensor is right."
    swapped = "The gauge falls when the pump pushes to its side: port and starboard are swapped."
    of_gauges = [
        agrees
        if sensor
        else swapped
        if port < 0 and starboard < 0
        else f"Only the {side} gauge counts downwards: correct its sign."
        if scale < 0
        else f"The {side} gauge does not move: check it, its pipe and its cable."
        if scale == 0
        else "The motion sensor shows no roll, and its push on the water is missing here."
        if roll == 0
        else f"Correct the {side} gauge's scaling."
        for side, scale in (("port", port), ("starboard", starboard))
    ]
    if roll == 0:
        of_roll = of_rate = "The motion sensor shows no roll: check it and its cable."
    elif sensor and abs(roll / pressure - 1) <= 2 * precision.ROLL_SCALE:
        of_roll, of_rate = agrees, of_derived or "Correct the sign or scaling of the roll rate."
    elif roll < 0:
        of_roll = "The roll has the wrong sign: it is positive starboard down. " + (
            "Turn the motion sensor round." if rate > 0 else "The roll rate's is right."
        )
        of_rate = of_derived or "It agrees once the roll has the right sign."
    else:
        of_roll = "Correct the roll's scaling; check the tank's measures in the ship's file."
        of_rate = of_derived or (
            "The roll rate has the wrong sign: it is positive while starboard goes down."
            if rate < 0
            else "Correct the scaling of the roll rate."
        )
    return Each(of_pressure, of_gauges[0], of_gauges[1], of_roll, of_rate)
