"""Numbers that know what they would be with a rule neutralised, and a record of the rules that matter.

One traced run of a case stands for one run a rule: a rule that turns no comparison on the way, and reaches no
code that cannot be followed, cannot change that case's answer.
"""

import dataclasses
import functools
import operator
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

# s: a function that took longer is not called again to see if a turned comparison changes its result, and
# none is called again for longer than this at a time.
WORTH_A_CALL, AT_A_TIME = 0.02, 0.2
DEPTH = 8


class Trace(threading.local):
    """The record of one run.

    matter: the rules that matter to the run, whatever thread found that. frames: those that matter to each
    function that is being called, innermost last; the first is ``matter``. active: the rule that is
    neutralised while a function is called again, else None.
    """

    matter: ClassVar[set[str]] = set()

    def __init__(self) -> None:
        self.frames: list[set[str]] = [self.matter]
        self.active: str | None = None

    def note(self, rules: Iterator[str] | set[str]) -> None:
        """These rules matter to the function that is being called."""
        if self.active is None:
            self.frames[-1].update(rules)

    def is_noted(self, rule: str) -> bool:
        """Whether it matters already to any function that is being called."""
        return any(rule in frame for frame in self.frames)


TRACE = Trace()


def same(one: Any, other: Any, depth: int = 0) -> bool:
    """Whether two results are equal, arrays and dataclasses by content; False where it is not known."""
    if one is other:
        return True
    if depth > DEPTH or type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype.kind in "bifc" and bool(np.array_equal(one, other, equal_nan=one.dtype.kind in "fc"))
    if isinstance(one, list | tuple):
        pairs = zip(one, other, strict=False)
        return len(one) == len(other) and all(same(a, b, depth + 1) for a, b in pairs)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key], depth + 1) for key in one)
    if dataclasses.is_dataclass(one):
        names = [field.name for field in dataclasses.fields(one)]
        return all(same(getattr(one, name), getattr(other, name), depth + 1) for name in names)
    if isinstance(one, float | np.floating):
        return bool(one == other or (one != one and other != other))
    if isinstance(one, bool | int | str | bytes | set | frozenset | np.generic | type(None)):
        return bool(one == other)
    return False


class Traced:
    """A number or an array, and what it would be with each of some rules neutralised.

    Arithmetic keeps both. A comparison notes the rules with which it would turn out otherwise; so does all
    that cannot be followed, such as an index or a call of compiled code, for every rule.
    """

    __slots__ = ("base", "others")

    def __init__(self, base: Any, others: Mapping[str, Any]) -> None:
        self.base, self.others = base, others

    def now(self, rule: str | None) -> Any:
        """The value with this rule neutralised; as it is for None."""
        return self.base if rule is None else self.others.get(rule, self.base)

    def plain(self) -> Any:
        """The value for code that cannot be followed."""
        TRACE.note({rule for rule, other in self.others.items() if not same(other, self.base)})
        return self.now(TRACE.active)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "__call__" and "out" not in options and ufunc.nout == 1:
            return _applied(functools.partial(ufunc, **options), *inputs)
        plain = [_plain(each) for each in inputs]
        return getattr(ufunc, method)(*plain, **{key: _plain(each) for key, each in options.items()})

    def __array_function__(self, function: Any, types: Any, inputs: Any, options: Any) -> Any:
        return function(*_plain(inputs), **_plain(options))

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return np.array(self.plain(), dtype=dtype)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.plain(), name)

    def __getitem__(self, key: Any) -> Any:
        return _applied(lambda value: value[_plain(key)], self)

    def __bool__(self) -> bool:
        return bool(_applied(bool, self))

    def __float__(self) -> float:
        return float(self.plain())

    def __int__(self) -> int:
        return int(self.plain())

    def __index__(self) -> int:
        return operator.index(self.plain())

    def __round__(self, digits: int | None = None) -> Any:
        return round(self.plain(), digits)

    def __len__(self) -> int:
        return len(self.plain())

    def __iter__(self) -> Iterator[Any]:
        return iter(self.plain())

    def __hash__(self) -> int:
        return hash(self.plain())

    def __format__(self, form: str) -> str:
        return format(self.now(TRACE.active), form)

    def __repr__(self) -> str:
        return repr(self.now(TRACE.active))


def _plain(value: Any) -> Any:
    """The value without tracing, in lists, tuples and mappings too."""
    if isinstance(value, Traced):
        return value.plain()
    if type(value) in (list, tuple):
        return type(value)(_plain(each) for each in value)
    if type(value) is dict:
        return {key: _plain(each) for key, each in value.items()}
    return value


def _applied(function: Callable[..., Any], *inputs: Any) -> Any:
    """The function of numbers, some of them traced: traced again, or the plain outcome of a comparison."""
    active = TRACE.active
    if active is not None:
        return function(*(each.now(active) if isinstance(each, Traced) else each for each in inputs))
    traced = [each for each in inputs if isinstance(each, Traced)]
    base = function(*(each.base if isinstance(each, Traced) else each for each in inputs))
    if base is NotImplemented:
        return base
    others = {}
    for rule in {rule for each in traced for rule in each.others}:
        values = (each.now(rule) if isinstance(each, Traced) else each for each in inputs)
        try:
            with np.errstate(all="ignore"):
                other = function(*values)
        except (ArithmeticError, ValueError):
            TRACE.note({rule})
            continue
        if not same(other, base):
            others[rule] = other
    if isinstance(base, bool | np.bool_) or (isinstance(base, np.ndarray) and base.dtype == bool):
        TRACE.note(set(others))
        return base
    return Traced(base, others) if others else base


def _forward(function: Callable[..., Any]) -> Any:
    return lambda self, *others: _applied(function, self, *others)


def _backward(function: Callable[..., Any]) -> Any:
    return lambda self, other: _applied(function, other, self)


for _name in ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "matmul"):
    setattr(Traced, f"__{_name}__", _forward(getattr(operator, _name)))
    setattr(Traced, f"__r{_name}__", _backward(getattr(operator, _name)))
for _name in ("lt", "le", "gt", "ge", "eq", "ne", "neg", "pos", "abs"):
    setattr(Traced, f"__{_name}__", _forward(getattr(operator, _name)))


def followed(name: str, neutral: Mapping[str, Any], is_opaque: bool) -> Callable[[Any], Any]:
    """Decorator of a pure function: its result is noted against each of its neutral ones.

    What turns inside matters to its caller only where it changes the result: it is called again with each
    such rule neutralised. name: for the rules. neutral: results by rule. is_opaque: whether it keeps what it
    finds, or changes an object, so that it cannot be called again.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def call(*inputs: Any, **options: Any) -> Any:
            if TRACE.active is not None:
                if TRACE.active in neutral:
                    return neutral[TRACE.active]
                return function(*inputs, **options)
            frame = TRACE.frames[0] if is_opaque else set[str]()
            TRACE.frames.append(frame)
            began = time.perf_counter()
            try:
                result = function(*inputs, **options)
            finally:
                TRACE.frames.pop()
                if not is_opaque:
                    left = set(frame)
            if is_opaque:
                return result
            took = time.perf_counter() - began
            open_ = {rule for rule in left if not TRACE.is_noted(rule)}
            if open_ and took < WORTH_A_CALL and not any(hasattr(each, "__next__") for each in inputs):
                result, open_ = _called_again(function, inputs, options, result, open_)
            TRACE.note(open_)
            TRACE.note({rule for rule, value in neutral.items() if not same(value, result)})
            return result

        return call

    return decorate


def _called_again(
    function: Callable[..., Any], inputs: Any, options: Any, result: Any, rules: set[str]
) -> tuple[Any, set[str]]:
    """The result, with what it would be by each rule where it is a number; and the rules that change it."""
    left, others = set[str](), dict[str, Any]()
    end = time.perf_counter() + AT_A_TIME
    for rule in sorted(rules):
        if time.perf_counter() > end:
            left.add(rule)
            continue
        TRACE.active = rule
        try:
            with np.errstate(all="ignore"):
                other = function(*inputs, **options)
        except Exception:
            left.add(rule)
            continue
        finally:
            TRACE.active = None
        before = result.now(rule) if isinstance(result, Traced) else result
        if same(_now(before, rule), other):
            continue
        if isinstance(before, float) and isinstance(other, float):
            others[rule] = other
        else:
            left.add(rule)
    if not others:
        return result, left
    known = result.others if isinstance(result, Traced) else {}
    return Traced(result.base if isinstance(result, Traced) else result, {**known, **others}), left


def _now(value: Any, rule: str) -> Any:
    """The value with the rule neutralised, in lists and tuples too."""
    if isinstance(value, Traced):
        return value.now(rule)
    if type(value) in (list, tuple):
        return type(value)(_now(each, rule) for each in value)
    return value
