"""A linear law given by its matrices, as control libraries design and discretize it.

::

    x+ = A x + B y,    u = C x + D y,    y the newest measurement

The loop counts a command one sample after the measurement that it is made of (see
`utank_hil.dynamics.sampling`): v(k + 1) = C x(k) + D y(k). In that count the transfer matrix is
that of the matrices divided by z, strictly proper whatever D is. The last command joins the states.
"""

from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.control.arx import discrete_matrices
from utank_hil.dynamics.sampling import LinearModel
from utank_hil.dynamics.transfer import state_space_response
from utank_hil.parameters import Problem, refuse


@dataclass(frozen=True, slots=True, eq=False)
class StateSpaceLaw:
    """A law by its matrices.

    Parameters
    ----------
    model : LinearModel
        From the m measured outputs to the r commands; discrete, ``dt`` in seconds. D is the answer
        to the newest measurement. The sign is the law's own: u = -K y has D = -K.

    Raises
    ------
    ValueError
        If the model is not discrete, its shapes do not fit each other, or a number is not finite.
    """

    model: LinearModel

    def __post_init__(self) -> None:
        a, b, c, d, sample_time_s = discrete_matrices(self.model)
        states, outputs, commands = len(a), b.shape[-1], len(c)
        shapes = ((states, states), (states, outputs), (commands, states), (commands, outputs))
        problems: list[Problem] = []
        for name, matrix, shape in zip("ABCD", (a, b, c, d), shapes, strict=True):
            if matrix.shape != shape:
                problems.append((name, f"must have shape {shape}, got {matrix.shape}"))
            elif not np.isfinite(matrix).all():
                problems.append((name, "must be of finite numbers"))
        refuse("state-space law", problems)
        object.__setattr__(self, "model", LinearModel(a, b, c, d, sample_time_s))

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.model.dt

    def controller(self) -> "StateSpaceController":
        """A new steppable controller, at rest."""
        return StateSpaceController(self)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        late: ComplexArray = state_space_response(self.model, z) / np.asarray(z)[:, None, None]
        return late

    def matrices(self) -> LinearModel:
        """The law from y to u in the loop's count; its states are x and the last command."""
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
    """Steps a `StateSpaceLaw`.

    Its state follows from the measurements alone, so what `applied` says changes nothing.

    Parameters
    ----------
    law : StateSpaceLaw
    """

    def __init__(self, law: StateSpaceLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._a, self._b, self._c, self._d, _ = law.model
        self._state: FloatArray = np.zeros(len(self._a))

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return C x + D (y - reference), shape (r,), and advance the state."""
        error = y if reference is None else y - reference
        u: FloatArray = self._c.dot(self._state) + self._d.dot(error)
        self._state = self._a.dot(self._state) + self._b.dot(error)
        return u

    def applied(self, u: FloatArray) -> None:
        """Nothing to remember."""

    def reset(self) -> None:
        """Forget the past: state zero."""
        self._state = np.zeros(len(self._a))
