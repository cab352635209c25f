"""No module of a tick, nor of the emulated ship, picks its arithmetic by the processor."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TICK = (
    "utank_hil/base/ordered_sums.py", "utank_hil/base/elementary.py",
    "utank_hil/canbus/*.py", "utank_hil/nodes/*.py", "utank_hil/runners/*.py",
    "utank_hil/safety/**/*.py",
    "utank_hil/control/constrained/preview.py",
    "utank_hil/control/feedback_linearization.py", "utank_hil/control/fuzzy/adaptive.py",
    "utank_hil/control/gain.py", "utank_hil/control/level_observer.py",
    "utank_hil/control/limit*.py", "utank_hil/control/semi_active.py",
    "utank_hil/control/state_space.py", "utank_hil/control/washout.py",
    "utank_hil/dynamics/kernels.py", "utank_hil/dynamics/linear.py",
    "utank_hil/dynamics/nonlinear.py", "utank_hil/dynamics/pump.py",
    "utank_hil/dynamics/ship.py", "utank_hil/dynamics/tank.py", "utank_hil/dynamics/valves.py",
    "utank_hil/retuning/adaptive.py", "utank_hil/retuning/answer.py",
    "utank_hil/retuning/estimate.py", "utank_hil/retuning/estimator.py",
    "utank_hil/retuning/law_*.py",
    "utank_hil/retuning/renewing.py", "utank_hil/retuning/trial.py",
    "utank_hil/sea/sea.py", "utank_hil/sea/spectrum.py", "utank_hil/sea/moment_table.py",
    "firmware_sim/drive*.py", "firmware_sim/plant*.py", "firmware_sim/sensors.py",
    "firmware_sim/truth.py", "firmware_sim/valve.py", "firmware_sim/voyage.py",
    "firmware_sim/waves.py",
)  # fmt: skip
PARTS = {
    "utank_hil/control/constrained/law.py": ("ConstrainedController",),
    "utank_hil/control/fuzzy/law.py": ("FuzzyBasis.memberships", "_degrees", "_gauss",
                                       "ErrorDynamics", "FuzzyController"),
    "utank_hil/control/lqg.py": ("LQGController.step", "LQGController.applied",
                                 "LQGController.innovation"),
    "utank_hil/control/predictive/law.py": ("PredictiveController",),
    "utank_hil/control/constrained/horizon.py": ("predictions", "_interpolation", "ActiveSetSolver",
                                                    "PlanProgramme"),
    "utank_hil/dynamics/sampling.py": ("transition_and_step",),
}  # fmt: skip
"""Of modules that design, too: what a tick runs through."""
UNUSED = re.compile(
    r"(\w+\.)+(response|matrices)$"  # frequency responses and state-space models: designs
    r"|Spectrum\.|\.?_?(spectrum|moment_0)$"
)
DISPATCHED = (
    "abs angle arccos arccosh arcsin arcsinh arctan arctan2 arctanh cbrt cos cosh dot einsum exp "
    "exp2 expm1 float_power hypot inner kron log log10 log1p log2 logaddexp matmul outer power sin "
    "sinc sinh tan tanh tensordot trace vdot"
)
LIBM = (
    "acos acosh asin asinh atan atan2 atanh cbrt cos cosh erf exp exp2 expm1 gamma hypot lgamma "
    "log log10 log1p log2 pow sin sinh tan tanh"
)
REAL = {"abs", "outer", "trace"}  # of real numbers: exact, or one rounding each
BANNED = (
    {f"np.{name}" for name in DISPATCHED.split() if name not in REAL}
    | {f"math.{name}" for name in LIBM.split()}
    | {"np.linalg", "np.fft", "np.polynomial", "scipy.linalg"}
)


def findings(source: str, scopes: tuple[str, ...] = ()) -> list[str]:
    """What a module, or its functions and classes of these names, lets the processor choose."""
    found = []

    def look(node: ast.AST, scope: str) -> None:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            scope = f"{scope}.{node.name}".lstrip(".")
        wanted = not scopes or any(f"{scope}.".startswith(f"{each}.") for each in scopes)
        if wanted and not (scope and UNUSED.match(scope)):
            said = _said(node)
            if said:
                found.append(f"{node.lineno}: {said}")  # type: ignore[attr-defined]
        for child in ast.iter_child_nodes(node):
            look(child, scope)

    look(ast.parse(source), "")
    return found


def _said(node: ast.AST) -> str:
    if isinstance(node, ast.BinOp | ast.AugAssign):
        if isinstance(node.op, ast.MatMult):
            return "@ is the linear-algebra library's"
        constants = isinstance(node, ast.BinOp) and all(
            isinstance(side, ast.Constant | ast.UnaryOp) for side in (node.left, node.right)
        )
        if isinstance(node.op, ast.Pow) and not constants:
            return "** is the C library's pow"
    if isinstance(node, ast.Attribute):
        name = ast.unparse(node)
        if name in BANNED:
            return name
        if node.attr == "dot":
            return f"{name} is the linear-algebra library's"
    if isinstance(node, ast.ImportFrom):
        names = {f"{node.module}.{each.name}" for each in node.names} | {f"{node.module}"}
        return ", ".join(names & BANNED)
    return ""


def modules() -> list[tuple[Path, tuple[str, ...]]]:
    whole = sorted({path for each in TICK for path in ROOT.glob(each)})
    return [(path, ()) for path in whole] + [(ROOT / name, part) for name, part in PARTS.items()]


@pytest.mark.parametrize(
    ("path", "scopes"), modules(), ids=lambda value: value.name if isinstance(value, Path) else ""
)
def test_no_sum_or_function_of_a_tick_is_chosen_by_the_processor(
    path: Path, scopes: tuple[str, ...]
) -> None:
    assert not findings(path.read_text(), scopes)


def test_each_pattern_and_part_is_there() -> None:
    assert all(any(ROOT.glob(each)) for each in TICK)
    for name, scopes in PARTS.items():
        tree = ast.parse((ROOT / name).read_text())
        known = {node.name for node in ast.walk(tree)
                 if isinstance(node, ast.FunctionDef | ast.ClassDef)}  # fmt: skip
        assert {scope.split(".")[-1] for scope in scopes} <= known, name


@pytest.mark.parametrize(
    "line",
    ["y = a @ b", "y @= b", "y = a.dot(b)", "y = np.linalg.inv(a)", "y = math.exp(x)", "y = x**2",
     "y = np.exp(a)", "from math import exp", "y = np.einsum('i,i', a, b)"],
)  # fmt: skip
def test_a_line_that_would_break_it_is_found(line: str) -> None:
    assert findings(f"class A:\n    def step(self, a):\n        {line}\n", ("A.step",))
    assert not findings(f"class A:\n    def step(self, a):\n        {line}\n", ("A.other",))
