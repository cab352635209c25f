"""What a ship has twice, or by wires of its own."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Redundancy:
    """Section ``redundancy`` of a vessel's file.

    Attributes
    ----------
    second_motion_sensor : bool
        SENSOR_MOTION_2 comes from a node apart from the first sensor's.
    hardwired_inputs : bool
        HARDWIRED_INPUTS, high-level switches and a stop loop by wires of their own, comes from a
        node apart from sensors and drive.
    second_station : bool
        A second operator's panel may take the command. Of one that is not declared only stop and
        disarm count.
    """

    second_motion_sensor: bool = False
    hardwired_inputs: bool = False
    second_station: bool = False


NO_REDUNDANCY = Redundancy()
