"""Every small change of a file that a test should notice.

A comparison moved by its boundary or turned round, a condition that always or never holds, an
operand left out, a sign, an operator, a number, another member of an enumeration, `min` for `max`,
a statement left out, a result that is lost.
"""

import ast
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

from tools.evidence.sources import ROOT

COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}
FLOAT_FACTOR = 1.25
# what is said to people, and what is not run
_SKIPPED = (ast.JoinedStr, ast.Import, ast.ImportFrom)
_SKIPPED_FIELDS = {"annotation", "returns", "exc"}
_LEFT_OUT = (ast.Expr, ast.Assign, ast.AugAssign, ast.Raise, ast.Return, ast.Continue, ast.Break)


@dataclass(frozen=True)
class Mutant:
    """One change.

    Attributes
    ----------
    line : int
        Of the source.
    where : str
        Qualified name of what holds it; empty for the module.
    before, after : str
        The line that differs, as Python writes it out.
    code : CodeType
        Of the whole module, changed.
    at_import : bool
        It is of what runs when the module is imported.
    twin : int
        How many before it are of the same words, of the same line elsewhere in `where`.
    """

    line: int
    where: str
    before: str
    after: str
    code: CodeType
    at_import: bool
    twin: int = 0

    @property
    def key(self) -> str:
        """What it is, wherever it stands."""
        words = f"{self.where}: {self.before} -> {self.after}"
        return f"{words} ({self.twin + 1})" if self.twin else words


def mutants_of(file: Path) -> tuple[CodeType, list[Mutant]]:
    """The code of a file as it is, and all its mutants."""
    tree = ast.parse(file.read_bytes())
    unchanged = compile(tree, str(file), "exec")
    found, seen = [], Counter[tuple[str, str, str]]()
    at_import = {"", *_called_at_import(tree)}
    for place in _places(tree, "", None):
        before = ast.unparse(place.statement).splitlines()
        for replacement in place.replacements:
            place.put(replacement)
            try:
                after = ast.unparse(place.holder if place.whole else place.statement).splitlines()
                code = compile(ast.fix_missing_locations(tree), str(file), "exec")
            finally:
                place.put(place.node)
            old, new = (before[0], "") if place.whole else _difference(before, after)
            line = getattr(place.node, "lineno", place.statement.lineno)
            words = (place.where, old, new)
            early = place.where.partition(".")[0] in at_import
            found.append(Mutant(line, *words, code, early, seen[words]))
            seen[words] += 1
    return unchanged, found


def _called_at_import(tree: ast.Module) -> set[str]:
    """Functions of a module that it calls itself, and those that they call in turn."""
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    waiting: list[ast.AST] = [node for node in tree.body
                              if not isinstance(node, ast.FunctionDef | ast.ClassDef)]  # fmt: skip
    found: set[str] = set()
    while waiting:
        called = {node.func.id for node in ast.walk(waiting.pop())
                  if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}  # fmt: skip
        new = called & functions.keys() - found
        found |= new
        waiting += [functions[name] for name in new]
    return found


def _difference(before: list[str], after: list[str]) -> tuple[str, str]:
    for old, new in zip(before, after, strict=False):
        if old != new:
            return old.strip(), new.strip()
    return before[0].strip(), after[0].strip()


@dataclass
class _Place:
    node: Any
    holder: Any
    field: str
    index: int | None
    statement: ast.stmt
    where: str
    replacements: list[ast.AST]
    whole: bool = False

    def put(self, node: ast.AST) -> None:
        if self.index is None:
            setattr(self.holder, self.field, node)
        else:
            getattr(self.holder, self.field)[self.index] = node


def _places(holder: ast.AST, where: str, statement: ast.stmt | None) -> Iterator[_Place]:
    """Every node that can be another, with what else it could be."""
    for field, value in ast.iter_fields(holder):
        if field in _SKIPPED_FIELDS:
            continue
        for index, node in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(node, ast.AST) or isinstance(node, _SKIPPED) or _is_words(node):
                continue
            at = index if isinstance(value, list) else None
            inside, own = where, statement
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                inside = f"{where}.{node.name}".lstrip(".")
            if isinstance(node, ast.stmt):
                own = node
                if isinstance(node, _LEFT_OUT) and where and not isinstance(holder, ast.ClassDef):
                    empty = ast.copy_location(ast.Pass(), node)
                    yield _Place(node, holder, field, at, node, where, [empty], whole=True)
            elif own is not None:
                replacements = list(_instead(node, holder, field))
                if replacements:
                    yield _Place(node, holder, field, at, own, where, replacements)
            yield from _places(node, inside, own)


def _is_words(node: ast.AST) -> bool:
    """Say whether it is a docstring, a list of names, or what only a type checker reads."""
    match node:
        case ast.Expr(value=ast.Constant()):
            return True
        case ast.Assign(targets=[ast.Name(id="__slots__")]):
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
    return False


def _is_slots(holder: ast.AST) -> bool:
    """Say whether it is how a class keeps its attributes, which changes nothing that it does."""
    return isinstance(holder, ast.keyword) and holder.arg == "slots"


def _instead(node: ast.AST, holder: ast.AST, field: str) -> Iterator[ast.AST]:
    """What may stand in the place of an expression."""
    condition = field == "test" or (field == "ifs" and isinstance(holder, ast.comprehension))
    if condition and not isinstance(holder, ast.Assert):
        yield ast.Constant(value=True)
        yield ast.Constant(value=False)
    match node:
        case ast.Compare(left=left, ops=ops, comparators=others):
            for index, old in enumerate(ops):
                for new in COMPARISONS[type(old)]:
                    changed = [*ops[:index], new(), *ops[index + 1 :]]
                    yield ast.Compare(left=left, ops=changed, comparators=others)
        case ast.BoolOp(op=op, values=values):
            yield ast.BoolOp(op=ast.Or() if isinstance(op, ast.And) else ast.And(), values=values)
            for index in range(len(values)):
                rest = [*values[:index], *values[index + 1 :]]
                yield ast.BoolOp(op=op, values=rest) if len(rest) > 1 else rest[0]
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            yield ast.BinOp(left=left, op=OPERATORS[type(op)](), right=right)
        case ast.Constant(value=bool(value)):
            if not _is_slots(holder):
                yield ast.Constant(value=not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value=value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(value=FLOAT_FACTOR * value if value else 1.0)
        case ast.Attribute(value=ast.Name(id="math"), attr="inf"):
            yield ast.Constant(value=math.pi)
        case ast.Attribute(value=ast.Name(id=name) as kind, attr=member):
            members = _enumerations().get(name, [])
            if member in members:
                other = members[(members.index(member) + 1) % len(members)]
                yield ast.Attribute(value=kind, attr=other, ctx=ast.Load())
        case ast.Name(id=name) if name in NAMES and isinstance(holder, ast.Call):
            yield ast.Name(id=NAMES[name], ctx=ast.Load())
    if isinstance(holder, ast.AugAssign) and isinstance(node, ast.operator):
        yield OPERATORS[type(node)]()
    is_nothing = isinstance(node, ast.Constant) and node.value is None
    if isinstance(holder, ast.Return) and not is_nothing:
        yield ast.Constant(value=None)


@cache
def _enumerations() -> dict[str, list[str]]:
    """Members of every enumeration of the packages, by its name."""
    found = {}
    for file in (*ROOT.glob("utank_hil/**/*.py"), *ROOT.glob("firmware_sim/**/*.py")):
        for node in ast.walk(ast.parse(file.read_bytes())):
            if isinstance(node, ast.ClassDef) and any(
                isinstance(base, ast.Name) and base.id.endswith(("Enum", "Flag"))
                for base in node.bases
            ):
                found[node.name] = [
                    target.id
                    for entry in node.body
                    if isinstance(entry, ast.Assign)
                    for target in entry.targets
                    if isinstance(target, ast.Name)
                ]
    for file in ROOT.glob("utank_hil/**/*.py"):
        for node in ast.parse(file.read_bytes()).body:
            match node:  # a short name for one of them
                case ast.Assign(targets=[ast.Name(id=short)], value=ast.Name(id=name)):
                    if name in found:
                        found[short] = found[name]
    return {name: members for name, members in found.items() if len(members) > 1}
