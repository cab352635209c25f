"""No module of a tick, nor of the emulated ship, picks its arithmetic by the processor."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = (
    "utank_hil/base/*.py", "utank_hil/canbus/**/*.py", "utank_hil/control/**/*.py",
    "utank_hil/configuration/ship_keys.py", "utank_hil/dynamics/**/*.py", "utank_hil/nodes/*.py",
    "utank_hil/retuning/*.py", "utank_hil/runners/*.py", "utank_hil/safety/**/*.py",
    "utank_hil/sea/*.py",
    "firmware_sim/*.py", "firmware_sim/fault_injection/*.py", "firmware_sim/guard/*.py",
)  # fmt: skip
"""Whole rooms: a new module is looked at, too, until it is named below."""
DESIGNS = {
    *(f"utank_hil/control/{name}.py" for name in
      ("arx", "constrained/design", "constrained/foresight", "lqg_design", "optimal_tank",
       "predictive/design", "python_law", "sea_model")),
    *(f"utank_hil/dynamics/{name}.py" for name in
      ("hull/hull_data", "hull/lateral", "hull/radiation", "roll_damping", "wrench")),
    "utank_hil/retuning/redesign.py", "utank_hil/retuning/renewal.py",
    "utank_hil/sea/harmonics.py", "utank_hil/sea/measured.py", "utank_hil/sea/ndbc.py",
    "firmware_sim/comparison.py", "firmware_sim/model_limits.py", "firmware_sim/report_tables.py",
    "firmware_sim/starter.py",
}  # fmt: skip
"""Modules that no tick runs through: designs, readers of files, judgements and tables."""
PARTS = {
    "utank_hil/control/constrained/law.py": ("ConstrainedController", "ConstrainedLaw.controller",
                                              "ConstrainedLaw.unlimited", "ConstrainedLaw._gain",
                                              "ConstrainedLaw.clipped"),
    "utank_hil/control/fuzzy/law.py": ("FuzzyBasis.memberships", "_degrees", "_gauss",
                                       "ErrorDynamics", "FuzzyController"),
    "utank_hil/control/lqg.py": ("LQGController", "GentleController"),
    "utank_hil/control/predictive/law.py": ("PredictiveController",),
    "utank_hil/control/constrained/horizon.py": ("predictions", "_interpolation", "ActiveSetSolver",
                                                    "PlanProgramme"),
    "utank_hil/control/stimulation.py": ("StimulationController",),
    "utank_hil/dynamics/sampling.py": ("transition_and_step",),
}  # fmt: skip
"""Of modules that design, too: what a tick runs through."""
UNUSED = re.compile(
    r"(\w+\.)+(response|matrices)$"  # frequency responses and state-space models: designs
    r"|Spectrum\.|\.?_?(spectrum|moment_0)$"
)
DISPATCHED = (
    "angle arccos arccosh arcsin arcsinh arctan arctan2 arctanh cbrt convolve corrcoef correlate "
    "cos cosh cov dot einsum exp exp2 expm1 float_power hypot i0 inner kron log log10 log1p log2 "
    "logaddexp matmul matvec polyfit power sin sinc sinh tan tanh tensordot vdot vecdot vecmat"
)
LIBM = (
    "acos acosh asin asinh atan atan2 atanh cbrt cos cosh erf exp exp2 expm1 gamma hypot lgamma "
    "log log10 log1p log2 pow sin sinh tan tanh"
)
BANNED = (
    {f"numpy.{name}" for name in DISPATCHED.split()}
    | {f"math.{name}" for name in LIBM.split()}
    | {"numpy.linalg", "numpy.fft", "numpy.polynomial", "scipy", "cmath"}
)


def findings(source, scopes=()):
    """What a module, or its functions and classes of these names, lets the processor choose."""
    tree = ast.parse(source)
    imported = dict(pair for node in ast.walk(tree) for pair in _imported(node))
    found = []

    def look(node, scope):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            scope = f"{scope}.{node.name}".lstrip(".")
        wanted = not scopes or any(f"{scope}.".startswith(f"{each}.") for each in scopes)
        if wanted and not (scope and UNUSED.match(scope)):
            said = _said(node, imported)
            if said:
                found.append(f"{node.lineno}: {said}")
        for child in ast.iter_child_nodes(node):
            look(child, scope)

    look(tree, "")
    return found


def _imported(node):
    """Names that an import binds, and what they are."""
    if isinstance(node, ast.Import):
        return [(each.asname or each.name.split(".")[0], each.name if each.asname else
                 each.name.split(".")[0]) for each in node.names]  # fmt: skip
    if isinstance(node, ast.ImportFrom):
        return [(each.asname or each.name, f"{node.module}.{each.name}") for each in node.names]
    return []


def _said(node, imported):
    if isinstance(node, ast.BinOp | ast.AugAssign):
        if isinstance(node.op, ast.MatMult):
            return "@ is the linear-algebra library's"
        constants = isinstance(node, ast.BinOp) and all(
            isinstance(side, ast.Constant | ast.UnaryOp) for side in (node.left, node.right)
        )
        if isinstance(node.op, ast.Pow) and not constants:
            return "** is the C library's pow"
    if isinstance(node, ast.Attribute):
        if node.attr == "dot":
            return f"{ast.unparse(node)} is the linear-algebra library's"
        first, *others = ast.unparse(node).split(".")
        return _banned(".".join([imported.get(first, ""), *others]))
    if isinstance(node, ast.Name):
        return _banned(imported.get(node.id, ""))
    return ", ".join(filter(None, (_banned(name) for _, name in _imported(node))))


def _banned(name):
    parts = name.split(".")
    if name == "scipy.interpolate.BSpline":  # its own C loops; docs/architecture.md names it
        return ""
    heads = {".".join(parts[:count]) for count in range(1, len(parts) + 1)}
    return name if heads & BANNED else ""


def modules():
    others = {ROOT / name for name in (*DESIGNS, *PARTS)}
    whole = sorted({path for each in ROOMS for path in ROOT.glob(each)} - others)
    return [(path, ()) for path in whole] + [(ROOT / name, part) for name, part in PARTS.items()]


@pytest.mark.parametrize(
    ("path", "scopes"), modules(), ids=lambda value: value.name if isinstance(value, Path) else ""
)
def test_no_sum_or_function_of_a_tick_is_chosen_by_the_processor(path, scopes):
    assert not findings(path.read_text(), scopes)


def test_each_room_part_and_exception_is_there():
    assert all(any(ROOT.glob(each)) for each in ROOMS)
    # one that needs to be named no more is held to the rule
    assert all(findings((ROOT / name).read_text()) for name in DESIGNS)
    for name, scopes in PARTS.items():
        tree = ast.parse((ROOT / name).read_text())
        known = {node.name for node in ast.walk(tree)
                 if isinstance(node, ast.FunctionDef | ast.ClassDef)}  # fmt: skip
        assert {scope.split(".")[-1] for scope in scopes} <= known, name


@pytest.mark.parametrize(
    "line",
    ["y = a @ b", "y @= b", "y = a.dot(b)", "y = np.linalg.inv(a)", "y = math.exp(x)", "y = x**2",
     "y = np.exp(a)", "from math import exp", "y = np.einsum('i,i', a, b)", "y = solve(a, b)",
     "y = sla.inv(a)", "y = numpy.dot(a, b)", "y = e(x)", "import scipy.linalg",
     "y = special.erf(x)", "y = cmath.exp(x)"],
)  # fmt: skip
def test_a_line_that_would_break_it_is_found(line):
    imports = (
        "import cmath\nimport math\nimport numpy\nimport numpy as np\nimport numpy.linalg as sla\n"
        "from math import exp as e\nfrom scipy import special\nfrom scipy.linalg import solve\n"
    )
    module = f"{imports}class A:\n    def step(self, a):\n        {line}\n"
    assert findings(module, ("A.step",))
    assert not findings(module, ("A.other",))
