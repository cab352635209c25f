"""A linear law given by its matrices, as control libraries design and discretize it.

::

    x+ = A x + B y,    u = C x + D y,    y the newest measurement

The loop counts a command one sample after its measurement (see `utank_hil.dynamics.sampling`):
v(k + 1) = C x(k) + D y(k). In that count the transfer matrix is that of the matrices divided by z,
strictly proper for any D. The last command becomes a state.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray, plausible
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import Finite, Problem, SampleTime, range_problems, refuse
from utank_hil.control.arx import discrete_matrices
from utank_hil.control.interface import BuiltLaw, DesignPlant
from utank_hil.control.predictive.design import measured_problems
from utank_hil.dynamics.sampling import LinearModel, state_space_response


@dataclass(frozen=True, slots=True, eq=False)
class StateSpaceLaw:
    """A discrete law by its matrices; ValueError for unlike shapes or no finite numbers."""

    #: From the m measured outputs to the r commands; discrete, ``dt`` in seconds. D is the direct
    #: gain on the newest measurement. The sign is the law's own: u = -K y has D = -K.
    model: LinearModel

    def __post_init__(self) -> None:
        a, b, c, d, sample_time_s = discrete_matrices(self.model)
        states, outputs, commands = len(a), b.shape[-1], len(c)
        shapes = ((states, states), (states, outputs), (commands, states), (commands, outputs))
        wanted = ("square", "rows as A", "columns as A", "rows as C, columns as B")
        problems: list[Problem] = []
        for name, matrix, shape, why in zip("ABCD", (a, b, c, d), shapes, wanted, strict=True):
            if matrix.shape != shape:
                problems.append((name, f"must have shape {shape}, got {matrix.shape}: {why}"))
            elif not np.isfinite(matrix).all():
                problems.append((name, "must be of finite numbers"))
        refuse("state-space law", problems)
        object.__setattr__(self, "model", LinearModel(a, b, c, d, sample_time_s))

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.model.dt

    def controller(self) -> "StateSpaceController":
        """Return a new steppable controller, at rest."""
        return StateSpaceController(self)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        late: ComplexArray = state_space_response(self.model, z) / np.asarray(z)[:, None, None]
        return late

    def matrices(self) -> LinearModel:
        """State-space model from y to u in the loop's count, with the last command as a state."""
        a, b, c, d, dt = self.model
        states, (commands, outputs) = len(a), d.shape
        return LinearModel(
            np.block([[a, np.zeros((states, commands))], [c, np.zeros((commands, commands))]]),
            np.vstack([b, d]),
            np.hstack([np.zeros((commands, states)), np.eye(commands)]),
            np.zeros((commands, outputs)),
            dt,
        )


class StateSpaceController:
    """Stepping of a `StateSpaceLaw`, whose state depends on the measurements alone."""

    def __init__(self, law: StateSpaceLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._a, self._b, self._c, self._d, _ = law.model
        self._state: FloatArray = np.zeros(len(self._a))

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return C x + D (y - reference), shape (r,), and advance the state."""
        y = plausible(y)
        error = y if reference is None else y - reference
        u = product(self._c, self._state) + product(self._d, error)
        self._state = product(self._a, self._state) + product(self._b, error)
        return u

    def applied(self, u: FloatArray) -> None:
        """Ignore the command, as the state does not depend on it."""

    def reset(self) -> None:
        """Set the state to zero."""
        self._state = np.zeros(len(self._a))


_Matrix = tuple[tuple[Finite, ...], ...]


@dataclass(frozen=True, slots=True)
class SystemMatrices:
    """Matrices of a discrete system, as rows of numbers in a file."""

    D: _Matrix
    sample_time_s: SampleTime
    A: _Matrix = ()  #: Omitted for a law without states.
    B: _Matrix = ()  #: Omitted for a law without states.
    C: _Matrix = ((),)  #: Omitted for a law without states.

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if len(self.D) != 1 or not self.D[0]:
            reason = "must be one row, for one pump, with a number for each measurement"
            problems.append(("D", f"{reason}, got {len(self.D)} rows"))
        for name in "ABCD":
            widths = {len(row) for row in getattr(self, name)}
            if len(widths) > 1:
                problems.append((name, f"has rows of {sorted(widths)} numbers: make them equal"))
        refuse("system", problems)
        self.law()

    def law(self) -> StateSpaceLaw:
        """The law of these matrices."""
        states, outputs = len(self.A), len(self.D[0])
        a = np.array(self.A, float) if self.A else np.zeros((0, states))
        b = np.array(self.B, float) if self.B else np.zeros((0, outputs))
        c, d = np.array(self.C, float), np.array(self.D, float)
        return StateSpaceLaw(LinearModel(a, b, c, d, self.sample_time_s))


@dataclass(frozen=True, slots=True)
class StateSpaceDesign:
    """A law of a configuration that is given by its matrices.

    ValueError is raised if `measured` does not name one output for each column of D.
    """

    #: Measurements of the law, in the order of the columns of B and D; names of `STATES`.
    measured: tuple[str, ...]
    system: SystemMatrices
    kind: Literal["state_space"] = "state_space"

    def __post_init__(self) -> None:
        problems = measured_problems(self.measured)
        inputs = len(self.system.D[0])
        if not problems and len(self.measured) != inputs:
            reason = f"must name {inputs} outputs, one for each column of D, got {self.measured}"
            problems = [("measured", reason)]
        refuse("state space", problems)

    def build(self, plant: DesignPlant) -> BuiltLaw:  # noqa: ARG002, it is designed already
        """Return the law, the same for any plant."""
        law = self.system.law()
        return BuiltLaw(law.controller, self.measured, law)
