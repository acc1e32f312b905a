"""Formulas compute a channel's mix where weights and curves do not suffice, as with products and conditions.

A formula is one Python expression, parsed by :mod:`ast` and refused unless every part of it is in a short list: names
of parameters, numbers, arithmetic, comparisons, ``and``, ``or``, ``not``, ``A if C else B`` and the functions of
:data:`FUNCTIONS`. It has no attributes, no subscripts and no other calls, its length and depth are bounded, and the
compiled code can use no name but those functions.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Indices, Parameters

MAX_LENGTH, MAX_PARTS, MAX_DEPTH, MAX_POWER = 600, 200, 24, 8

Values = list[float]
Compiled = Callable[[Values], float]


def clamp(x: float, low: float, high: float) -> float:
    """Clip ``x`` to the range from ``low`` to ``high``."""
    return min(max(x, low), high)


def smoothstep(x: float, low: float = 0.0, high: float = 1.0) -> float:
    """Hermite step 3 t^2 - 2 t^3 of ``x``: 0 at ``low``, 1 at ``high``, constant beyond."""
    t = clamp((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def lerp(a: float, b: float, t: float) -> float:
    """Interpolate linearly: ``a`` where ``t`` is 0, ``b`` where it is 1; extrapolates beyond."""
    return a + (b - a) * t


FUNCTIONS: dict[str, tuple[Callable[..., float], int, int]] = {
    "min": (min, 2, 16),
    "max": (max, 2, 16),
    "abs": (abs, 1, 1),
    "sqrt": (math.sqrt, 1, 1),
    "sin": (math.sin, 1, 1),
    "cos": (math.cos, 1, 1),
    "clamp": (clamp, 3, 3),
    "smoothstep": (smoothstep, 1, 3),
    "lerp": (lerp, 3, 3),
}
"""Functions of formulas, each with its least and greatest number of arguments; sin and cos take radians."""

_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.USub, ast.UAdd, ast.Not, ast.And, ast.Or,
              ast.Lt, ast.LtE, ast.Gt, ast.GtE)  # fmt: skip
_SIGNS = "+ - * / ** < <= > >= and or not if else"
_PARTS = (ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp)


@dataclass(frozen=True)
class Formula:
    """A parsed formula. text : as it was written. names : the parameters in it, each once."""

    text: str
    names: tuple[str, ...]

    def compiled(self, parameters: Parameters) -> Compiled:
        """Compile it to a function of a list of parameter values (p,), NaN where there is no value, as for 1/0.

        Raises ParameterError: a name is no parameter.
        """
        tree = _Bind({name: parameters.index(name) for name in self.names}).visit(_parse(self.text))
        made: Compiled = eval(compile(ast.fix_missing_locations(_function(tree)), "<formula>", "eval"), _scope())
        return _without_errors(made)


def parse_formula(text: str) -> Formula:
    """Read a formula. Raises ValueError that names what is not allowed in it, and where."""
    tree = _parse(text)
    parts = list(_parts(tree.body, 1))
    if len(parts) > MAX_PARTS:
        raise ValueError(f"is too long: {len(parts)} parts, {MAX_PARTS} at most")
    for part in parts:
        _check(part, text)
    called = {id(part.func) for part in parts if isinstance(part, ast.Call)}
    names = [part.id for part in parts if isinstance(part, ast.Name) and id(part) not in called]
    return Formula(text, tuple(dict.fromkeys(names)))


def _parse(text: str) -> ast.Expression:
    if len(text) > MAX_LENGTH:
        raise ValueError(f"is too long: {len(text)} characters, {MAX_LENGTH} at most")
    try:
        return ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise ValueError(f"cannot be read at character {error.offset or 0}: {error.msg}") from error
    except (RecursionError, MemoryError, ValueError) as error:
        raise ValueError("cannot be read: it is nested too deeply, or has characters that no formula has") from error


def _parts(node: ast.AST, depth: int) -> Iterator[ast.AST]:
    """Yield every part of a formula but its operators. Raises ValueError where it is nested too deeply."""
    if depth > MAX_DEPTH:
        raise ValueError(f"is nested too deeply: {MAX_DEPTH} levels at most")
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.operator | ast.unaryop | ast.boolop | ast.cmpop | ast.expr_context):
            yield from _parts(child, depth + 1)
        elif not isinstance(child, (*_OPERATORS, ast.Load)):
            raise ValueError(
                f"{type(child).__name__} is not allowed; there are + - * / ** < <= > >= and or not if else"
            )


def _check(part: ast.AST, text: str) -> None:
    """Raise ValueError for a part that is not allowed in a formula."""
    shown = ast.get_source_segment(text.strip(), part) or text
    if isinstance(part, ast.Constant):
        value = part.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e9:
            raise ValueError(f"{shown} is no number below 1e9")
    elif isinstance(part, ast.Call):
        _check_call(part, shown)
    elif isinstance(part, ast.BinOp) and isinstance(part.op, ast.Pow):
        power = part.right.value if isinstance(part.right, ast.Constant) else None
        if type(power) is not int or not 1 <= power <= MAX_POWER:
            raise ValueError(f"{shown}: a power must be a whole number from 1 to {MAX_POWER}")
    elif not isinstance(part, (*_PARTS, ast.Name)):
        raise ValueError(f"{shown!r} is not allowed in a formula; it has numbers, parameters, operators and "
                         f"{', '.join(FUNCTIONS)}")  # fmt: skip


def _check_call(call: ast.Call, shown: str) -> None:
    if not isinstance(call.func, ast.Name) or call.func.id not in FUNCTIONS or call.keywords:
        raise ValueError(f"{shown}: there are only the functions {', '.join(FUNCTIONS)}")
    _, fewest, most = FUNCTIONS[call.func.id]
    if not fewest <= len(call.args) <= most:
        raise ValueError(f"{shown}: {call.func.id} takes {fewest if fewest == most else f'{fewest} to {most}'} values")


class _Bind(ast.NodeTransformer):
    """Replaces names by items of a list ``v``, and numbers by floats, whose powers cannot exhaust memory."""

    def __init__(self, places: dict[str, int]) -> None:
        self._places = places

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id not in self._places:
            return node  # a function
        return ast.Subscript(ast.Name("v", ast.Load()), ast.Constant(self._places[node.id]), ast.Load())

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        left, power = self.visit(node.left), isinstance(node.op, ast.Pow)
        return ast.BinOp(left, node.op, node.right if power else self.visit(node.right))

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant(float(node.value)) if isinstance(node.value, int | float) else node


def _function(tree: ast.Expression) -> ast.Expression:
    """Return the tree of ``lambda v: TREE``."""
    arguments = ast.arguments(posonlyargs=[], args=[ast.arg("v")], kwonlyargs=[], kw_defaults=[], defaults=[])
    return ast.Expression(ast.Lambda(arguments, tree.body))


def _scope() -> dict[str, Any]:
    return {"__builtins__": {}, **{name: function for name, (function, _, _) in FUNCTIONS.items()}}


def _without_errors(function: Compiled) -> Compiled:
    def value(values: Values) -> float:
        try:
            return float(function(values))
        except (ArithmeticError, ValueError):
            return math.nan

    return value


@dataclass(frozen=True)
class ChannelFormulas:
    """Formulas of ``n`` channels. at : (n,) their indices. needs : (k,) indices of the parameters that they name."""

    at: Indices
    needs: Indices
    functions: tuple[Compiled, ...]

    @classmethod
    def of(cls, formulas: Sequence[tuple[int, Formula]], parameters: Parameters) -> ChannelFormulas:
        """Create from pairs of channel index and formula. Raises ParameterError where a name is no parameter."""
        names = dict.fromkeys(name for _, formula in formulas for name in formula.names)
        return cls(
            np.array([at for at, _ in formulas], dtype=np.intp),
            np.unique(parameters.indices(names)),
            tuple(formula.compiled(parameters) for _, formula in formulas),
        )

    def __call__(self, values: Floats) -> Floats:
        """(n,) values of the formulas for parameters (p,); NaN where a formula has no value."""
        given = values.tolist()
        return np.array([function(given) for function in self.functions])


def formula_faults(text: str, parameters: Parameters) -> list[str]:
    """List errors of a formula that can be parsed: names that are no parameters, no value for the neutral face."""
    formula, faults = parse_formula(text), []
    for name in formula.names:
        try:
            parameters.index(name)
        except ParameterError as error:
            faults.append(str(error))
    if not faults and not math.isfinite(formula.compiled(parameters)(parameters.neutral().tolist())):
        faults.append("has no value for the neutral face: it divides by zero there, or takes a root of less than zero")
    return faults
