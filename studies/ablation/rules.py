"""The rules of the diagnosis, found in its source, and how they are neutralised while it is imported.

A rule is a number at module level, or a function that answers yes or no, finds something or nothing (None),
or lists structure that no effect explains. A number is neutralised by either of its ends, where its
comparison never turns; a function by an answer that is always the same.
"""

import ast
import importlib.machinery
import importlib.util
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from .traced import Traced, followed

PACKAGE = "diagnosis"
# Rooms and files that decide; the others read, write, plot or only do sums.
ROOMS = ("plausibility", "decision", "search", "proposals", "held_out", "diagnose")
FILES = (
    "residual.unexplained",
    "model.effect_sizes",
    "fit.torque_alignment",
    "fit.encoder_zeros",
    "fit.linearisation",
)
# Which effects would not show is no part of an answer that is scored.
LEFT_OUT = ("diagnosis.plausibility.observability",)
# A tuple of so many numbers is a grid.
FEWEST_OF_A_GRID = 4
# In place of a count that is neutralised upwards; loops run that often.
COUNTLESS = 100
NUMBER, FUNCTION = "_rule_number", "_rule_function"


@dataclass(frozen=True)
class Rule:
    """One way to neutralise a number or a function.

    place: module and name, with the place among its numbers where it has several. value: as it is, in words.
    off: as it is neutralised. line: of the source.
    """

    place: str
    value: str
    off: str
    line: int

    @property
    def key(self) -> str:
        """A name of its own."""
        return f"{self.place} = {self.off}"


def ends(value: float) -> dict[str, float]:
    """The values that neutralise a number, by their names: none and without end.

    value: of a literal, which has no sign.
    """
    found = {"0": 0, "inf": COUNTLESS} if isinstance(value, int) else {"0": 0.0, "inf": math.inf}
    return {name: end for name, end in found.items() if end != value}


def modules() -> tuple[str, ...]:
    """Names of the modules whose rules are tried."""
    spec = importlib.util.find_spec(PACKAGE)
    assert spec is not None
    assert spec.origin is not None
    root = Path(spec.origin).parent
    found = (
        ".".join([PACKAGE, *path.relative_to(root).with_suffix("").parts]) for path in root.rglob("*.py")
    )
    return tuple(sorted(name for name in found if is_tried(name)))


def is_tried(module: str) -> bool:
    """Whether its rules are tried."""
    parts = module.split(".")
    decides = len(parts) > 1 and (parts[1] in ROOMS or ".".join(parts[1:]) in FILES)
    return parts[0] == PACKAGE and decides and module not in LEFT_OUT


def rules() -> dict[str, Rule]:
    """All rules by their keys."""
    found: dict[str, Rule] = {}
    for module in modules():
        visitor = _Marked(module)
        visitor.visit(ast.parse(_source(module)))
        found |= {rule.key: rule for rule in visitor.found}
    return found


def install(off: str | None) -> None:
    """Have ``diagnosis`` imported with one rule neutralised, or, for None, with all of them traced.

    Raises RuntimeError where it is imported already.
    """
    if any(name.split(".")[0] == PACKAGE and is_tried(name) for name in sys.modules):
        raise RuntimeError("diagnosis is imported already: a rule is neutralised as it is")
    sys.meta_path.insert(0, _Finder(off))


class _Marked(ast.NodeTransformer):
    """Marks the numbers and functions of a module, so that each passes one that knows its name."""

    def __init__(self, module: str) -> None:
        self.short = module.removeprefix(f"{PACKAGE}.")
        self.found: list[Rule] = []
        self.scope: list[str] = []

    def visit_Module(self, node: ast.Module) -> ast.Module:
        node.body = [self._statement(each) for each in node.body]
        return node

    def _statement(self, node: ast.stmt) -> ast.stmt:
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            node.value = self._values(node.targets[0], node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            node.value = self._values(node.target, node.value)
        elif isinstance(node, ast.ClassDef):
            self.scope.append(node.name)
            node.body = [self._function(e) if isinstance(e, ast.FunctionDef) else e for e in node.body]
            self.scope.pop()
        elif isinstance(node, ast.FunctionDef):
            return self._function(node)
        return node

    def _values(self, target: ast.expr, value: ast.expr) -> ast.expr:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=True)
            value.elts = [self._values(*pair) for pair in pairs]
            return value
        if not isinstance(target, ast.Name) or not target.id.isupper():
            return value
        place = f"{self.short}.{target.id}"
        if _is_grid(value):
            return value
        numbers = [each for each in ast.walk(value) if _is_number(each)]
        marks = _Numbers(place, len(numbers), self.found)
        return marks.visit(value)

    def _function(self, node: ast.FunctionDef) -> ast.FunctionDef:
        kept = {_name_of(each) for each in node.decorator_list}
        if any(isinstance(each, ast.Yield | ast.YieldFrom) for each in ast.walk(node)):
            return node
        place = ".".join([self.short, *self.scope, node.name])
        returns = ast.unparse(node.returns) if node.returns is not None else ""
        is_opaque = returns == "None" or bool(kept - {"property", "staticmethod", "classmethod"})
        neutral = () if is_opaque else _neutral(returns)
        self.found += [Rule(place, returns, each, node.lineno) for each in neutral]
        mark = ast.parse(f"{FUNCTION}({place!r}, {neutral!r}, {is_opaque!r})", mode="eval").body
        node.decorator_list.append(mark)
        return node


class _Numbers(ast.NodeTransformer):
    """Marks the numbers of one value. count: how many there are."""

    def __init__(self, place: str, count: int, found: list[Rule]) -> None:
        self.place, self.count, self.found, self.seen = place, count, found, 0

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        if not _is_number(node):
            return node
        self.seen += 1
        place = self.place if self.count == 1 else f"{self.place}[{self.seen - 1}]"
        value = node.value
        assert isinstance(value, int | float)
        self.found += [Rule(place, f"{value:g}", each, node.lineno) for each in ends(value)]
        return ast.parse(f"{NUMBER}({value!r}, {place!r})", mode="eval").body


def _is_number(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
    )


def _is_grid(value: ast.expr) -> bool:
    """Whether it is a row of values to be tried, not numbers to be compared with."""
    if isinstance(value, ast.Call):
        return True
    return (
        isinstance(value, ast.Tuple)
        and len(value.elts) >= FEWEST_OF_A_GRID
        and all(map(_is_number, value.elts))
    )


def _name_of(node: ast.expr) -> str:
    node = node.func if isinstance(node, ast.Call) else node
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else "?"


# Answers of a function that is neutralised, as Python reads them.
ANSWERS: dict[str, Any] = {"True": True, "False": False, "None": None, "()": ()}


def _neutral(returns: str) -> tuple[str, ...]:
    """The answers that neutralise a function, by what it is declared to return."""
    if returns == "bool":
        return "False", "True"
    if returns.endswith("| None"):
        return ("None",)
    return ("()",) if returns == "tuple[Unclaimed, ...]" else ()


def _source(module: str) -> str:
    spec = importlib.machinery.PathFinder.find_spec(module, _folders(module))
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text(encoding="utf-8")


def _folders(module: str) -> Sequence[str] | None:
    spec = importlib.util.find_spec(PACKAGE)
    assert spec is not None
    assert spec.submodule_search_locations is not None
    root = Path(next(iter(spec.submodule_search_locations)))
    return [str(root.joinpath(*module.split(".")[1:-1]))]


class _Finder(MetaPathFinder):
    """Finds the modules whose rules are tried, to be marked as they are loaded."""

    def __init__(self, off: str | None) -> None:
        self.off = off

    def find_spec(self, fullname: str, path: Any, target: ModuleType | None = None) -> Any:
        """The module's spec with a loader that marks it; None for any other module."""
        if not is_tried(fullname):
            return None
        short = fullname.removeprefix(f"{PACKAGE}.")
        if self.off is not None and not self.off.startswith(short + "."):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        if spec is not None and spec.origin is not None and not spec.submodule_search_locations:
            spec.loader = _Loader(fullname, spec.origin, self.off)
        return spec


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a marked module."""

    def __init__(self, name: str, path: str, off: str | None) -> None:
        super().__init__(name, path)
        self.off = off

    def get_code(self, fullname: str) -> CodeType:
        """The code of the marked source, never from a cache."""
        tree = _Marked(fullname).visit(ast.parse(Path(self.path).read_text(encoding="utf-8")))
        code: CodeType = compile(ast.fix_missing_locations(tree), self.path, "exec")
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run the module with the marks known to it."""
        number, function = (_traced_number, _traced_function) if self.off is None else _neutralised(self.off)
        vars(module)[NUMBER], vars(module)[FUNCTION] = number, function
        super().exec_module(module)


def _traced_number(value: float, place: str) -> Any:
    return Traced(value, {f"{place} = {name}": end for name, end in ends(value).items()})


def _traced_function(place: str, neutral: Sequence[str], is_opaque: bool) -> Callable[[Any], Any]:
    return followed(place, {f"{place} = {each}": ANSWERS[each] for each in neutral}, is_opaque)


def _neutralised(off: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The marks with one rule neutralised and all else as it is."""

    def number(value: float, place: str) -> float:
        return next((end for name, end in ends(value).items() if f"{place} = {name}" == off), value)

    def function(place: str, neutral: Sequence[str], is_opaque: bool) -> Callable[[Any], Any]:
        def decorate(original: Callable[..., Any]) -> Callable[..., Any]:
            for each in neutral:
                if f"{place} = {each}" == off:
                    return lambda *inputs, **options: ANSWERS[each]
            return original

        return decorate

    return number, function
