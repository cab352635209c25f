"""A controller that leaves the tank a passive damper."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Range, SampleTime, range_problems, refuse
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import BuiltLaw, Memoryless


@dataclass(slots=True, eq=False)
class PassiveController(Memoryless):
    """Zero pressure for each of `inputs` pumps, for any measurement."""

    inputs: Annotated[int, Range(least=1)] = 1
    sample_time_s: SampleTime = 0.2

    def __post_init__(self) -> None:
        refuse("passive", range_problems(self))

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Return zero pressure, shape (r,)."""
        return np.zeros(self.inputs)


@dataclass(frozen=True, slots=True)
class PassiveDesign:
    """The passive tank as a law of a configuration."""

    kind: Literal["passive"] = "passive"

    def build(self, plant: DesignPlant) -> BuiltLaw:  # noqa: ARG002, the same for all
        """Return zero pressure; there is no loop."""
        return BuiltLaw(PassiveController, ("roll_rad",), closes_loop=False)
