"""User-defined law: Python code outside this package, named in a configuration.

The configuration names a factory: ``package.module:function`` of an installed package, or
``./file.py:function`` of a file beside the configuration. It is called with the configured
parameters, and with the `DesignPlant` if it has a parameter named ``plant``. It returns a new
`Controller` at rest: an object with ``sample_time_s``, ``step(y)``, ``applied(u)`` and ``reset()``.
If this has an attribute ``linear``, its loop is judged by it: a discrete state-space model from the
newest measurement to the command, such as a `control.StateSpace`, or a `LinearLaw`. Else it is
judged by its impulse response at rest.
"""

import importlib
import importlib.util
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np

from utank_hil.base.parameters import ParameterError, refuse
from utank_hil.control.interface import BuiltLaw, Controller, DesignPlant, LinearLaw
from utank_hil.control.predictive.design import measured_problems
from utank_hil.control.state_space import StateSpaceLaw

_PROBE, _COMPARED, _ALIKE = 1e-3, 50, 1e-3  # impulse, steps, relative tolerance
_METHODS = ("step", "applied", "reset")


@dataclass(frozen=True, slots=True)
class PythonDesign:
    """A law of a configuration that is user-defined code.

    ValueError is raised if `factory` is not of that form, or `measured` names no outputs.
    """

    #: ``package.module:function`` of an installed package, or ``./file.py:function`` of a file,
    #: from the folder of the configuration.
    factory: str
    measured: tuple[str, ...]  #: Measurements of the law, in order; names of `STATES`.
    #: Keyword arguments of the factory.
    parameters: Mapping[str, Any] = field(default_factory=dict)
    kind: Literal["python"] = "python"

    def __post_init__(self) -> None:
        problems = measured_problems(self.measured)
        module, colon, name = self.factory.rpartition(":")
        known = _is_file(module) or all(part.isidentifier() for part in module.split("."))
        if not (colon and known and name.isidentifier()):
            reason = (
                "must be of the form package.module:function, or ./file.py:function, got "
                f"{self.factory!r}"
            )
            problems.append(("factory", reason))
        refuse("python", problems)

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Call the factory; ParameterError if it can't be, or makes no controller that steps."""
        make = partial(_call, self.factory, dict(self.parameters), plant)
        controller = make()
        _try_out(controller, len(self.measured))
        if make() is controller:
            reason = "returned the same controller twice: it must make a new one each time"
            raise _refused("factory", reason)
        linear = _linear_of(controller, len(self.measured))
        if linear is not None:
            _compare(make(), linear, len(self.measured))
        return BuiltLaw(make, self.measured, linear)


def _call(factory: str, parameters: dict[str, Any], plant: DesignPlant) -> Controller:
    """Return a new controller; a module-level function, so that it can be pickled."""
    function = _imported(factory)
    try:
        signature = inspect.signature(function)
        if "plant" in signature.parameters:
            parameters = {"plant": plant, **parameters}
        signature.bind(**parameters)
    except TypeError as error:
        raise _refused("parameters", f"do not fit {factory}: {error}") from error
    try:
        controller: Controller = function(**parameters)
    except (Exception, SystemExit) as error:
        reason = f"{factory} failed: {type(error).__name__}: {error}"
        raise _refused("factory", reason) from error
    return controller


def _imported(factory: str) -> Callable[..., Any]:
    module_name, _, name = factory.rpartition(":")
    try:
        if _is_file(module_name):
            module = _of_file(Path(module_name).resolve())
        else:
            module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        reason = f"can't import {module_name}: {type(error).__name__}: {error}"
        if isinstance(error, ModuleNotFoundError) and not _is_file(module_name):
            reason += f"; install it, or name its file, ./{module_name}.py:{name}"
        raise _refused("factory", reason) from error
    function: object = getattr(module, name, None)
    if not callable(function):
        raise _refused("factory", f"module {module_name} has no function {name}")
    return function


def _is_file(module: str) -> bool:
    return module.endswith(".py")


@cache
def _of_file(path: Path) -> ModuleType:
    """Import a file as a module that no other module can import by name."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _try_out(controller: Controller, outputs: int) -> None:
    """Step a controller once at rest, to find its defects before it is on the bus."""
    lacking = [name for name in _METHODS if not callable(getattr(controller, name, None))]
    if lacking:
        reason = f"returned an object without {', '.join(lacking)}"
        raise _refused("factory", reason)
    sample_time_s: Any = getattr(controller, "sample_time_s", None)
    known = isinstance(sample_time_s, Real) and not isinstance(sample_time_s, bool)
    if not (known and 0 < sample_time_s < math.inf):
        reason = f"returned an object whose sample_time_s is {sample_time_s!r}, not a time"
        raise _refused("factory", reason)
    try:
        answer = controller.step(np.zeros(outputs))
        controller.applied(np.zeros(1))
        controller.reset()
    except (Exception, SystemExit) as error:
        reason = f"returned a controller that fails at rest: {type(error).__name__}: {error}"
        raise _refused("factory", reason) from error
    if not (isinstance(answer, np.ndarray) and answer.shape == (1,) and np.isfinite(answer).all()):
        reason = f"returned a controller whose step gives {answer!r}, not a pressure of shape (1,)"
        raise _refused("factory", reason)


def _linear_of(controller: Controller, outputs: int) -> LinearLaw | None:
    """The controller's own linear law, if it has one."""
    own: Any = getattr(controller, "linear", None)
    if own is None:
        return None
    try:
        law: LinearLaw = StateSpaceLaw(own) if hasattr(own, "A") else own
        model, period_s = law.matrices(), law.sample_time_s
        law.response(np.ones(1, dtype=np.complex128))
    except (AttributeError, TypeError, ValueError) as error:
        reason = f"returned a controller whose linear is no linear law: {error}"
        raise _refused("factory", reason) from error
    if abs(period_s - controller.sample_time_s) > 1e-9:
        reason = f"has sample_time_s {controller.sample_time_s:g}, but its linear has {period_s:g}"
        raise _refused("factory", reason)
    if model.D.any():
        reason = (
            "returned a controller whose linear answers in the sample it measures: give the "
            "state-space model itself, or a StateSpaceLaw of it"
        )
        raise _refused("factory", reason)
    if model.D.shape != (1, outputs):
        reason = f"returned a controller whose linear is {model.D.shape}, not (1, {outputs})"
        raise _refused("factory", reason)
    return law


def _compare(controller: Controller, linear: LinearLaw, outputs: int) -> None:
    """Refuse a linear law whose first impulse responses differ from the controller's."""
    a, b, c, _, _ = linear.matrices()
    y, states = np.full(outputs, _PROBE), b @ np.full((outputs, 1), _PROBE)
    answers, expected = [], []
    for _ in range(_COMPARED):
        answers.append(float(controller.step(y)[0]))
        controller.applied(np.array(answers[-1:]))
        expected.append((c @ states).item())
        y, states = np.zeros(outputs), a @ states
    largest = max(map(abs, expected + answers))
    if not np.allclose(answers, expected, rtol=0, atol=_ALIKE * largest):
        worst = int(np.argmax(np.abs(np.subtract(answers, expected))))
        reason = (
            f"returned a controller that answers an impulse of {_PROBE:g} with "
            f"{answers[worst]:.4g} Pa at step {worst + 1}, its linear with {expected[worst]:.4g} Pa"
        )
        raise _refused("factory", reason)


def _refused(key: str, reason: str) -> ParameterError:
    return ParameterError("python", [(key, reason)])
