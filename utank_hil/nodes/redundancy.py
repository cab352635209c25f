"""What a ship has twice, or by wires of its own."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Redundancy:
    """Section ``redundancy`` of a vessel's file."""

    #: SENSOR_MOTION_2 comes from a node apart from the first sensor's.
    second_motion_sensor: bool = False
    #: HARDWIRED_INPUTS, high-level switches and a stop loop by wires of their own, comes from a
    #: node apart from sensors and drive.
    hardwired_inputs: bool = False
    #: A second operator's panel may take the command. Of one that is not declared only stop, disarm
    #: and a ban on retuning count.
    second_station: bool = False


NO_REDUNDANCY = Redundancy()
