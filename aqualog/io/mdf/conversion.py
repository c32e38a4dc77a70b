"""Convert the raw samples of an MDF channel to physical numbers.

An algebraic conversion is text in the file. It is parsed against an allow-list of arithmetic and never executed; all
else is refused.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, FloatArray
from aqualog.io.mdf.blocks import Conversion

__all__ = ["Formula", "converted", "physical", "refusal", "takes_floats"]

_Array = NDArray[Any]

_LONGEST = 500  # characters; real formulas have a few dozen, and the parser's depth must stay bounded

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.USub: np.negative, ast.UAdd: np.positive}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "log": (1, np.log), "ln": (1, np.log), "log10": (1, np.log10), "exp": (1, np.exp), "sqrt": (1, np.sqrt),
    "sin": (1, np.sin), "cos": (1, np.cos), "tan": (1, np.tan), "asin": (1, np.arcsin), "acos": (1, np.arccos),
    "atan": (1, np.arctan), "sinh": (1, np.sinh), "cosh": (1, np.cosh), "tanh": (1, np.tanh),
    "abs": (1, np.abs), "pow": (2, np.power),
}  # fmt: skip


class Formula:
    """An algebraic conversion: numbers, X or X1, + - * / ** ^ and the functions of `_FUNCTIONS`.

    `^` is the power and `log` the natural logarithm, as in asammdf.

    Raises
    ------
    LogError
        If the text holds anything else. Nothing of the text is ever executed.
    """

    def __init__(self, text: str) -> None:
        self.text = " ".join(text.split())
        if not self.text or len(self.text) > _LONGEST:
            raise self._refused(f"has {len(self.text)} characters")
        try:
            self._tree = ast.parse(self.text.replace("^", "**"), mode="eval").body
            self._evaluate(self._tree, np.zeros(1))
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise self._refused("does not parse") from error

    def __call__(self, raw: _Array) -> FloatArray:
        """Physical values of raw ones. Shape (n,)."""
        x = raw.astype(np.float64)
        return np.broadcast_to(np.asarray(self._evaluate(self._tree, x), dtype=np.float64), x.shape).copy()

    def _refused(self, why: str) -> LogError:
        return LogError(f"conversion formula {self.text[:60]!r} {why}", expected="arithmetic of X")

    def _evaluate(self, node: ast.expr, x: FloatArray) -> Any:
        with np.errstate(all="ignore"):
            match node:
                # numpy numbers, so that 9**9**9**9 is inf at once instead of an integer of a gigabyte
                case ast.Constant(value=float() as value):
                    return np.float64(value)
                case ast.Constant(value=int() as value) if not isinstance(value, bool):
                    return np.float64(value) if value.bit_length() < 1024 else np.inf
                case ast.Name(id="X" | "X1" | "x" | "x1"):
                    return x
                case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                    return _BINARY[type(op)](self._evaluate(left, x), self._evaluate(right, x))
                case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _UNARY:
                    return _UNARY[type(sign)](self._evaluate(operand, x))
                case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name.lower() in _FUNCTIONS:
                    arity, function = _FUNCTIONS[name.lower()]
                    if len(args) == arity:
                        return function(*(self._evaluate(a, x) for a in args))
        raise self._refused("is not plain arithmetic")


def refusal(conversion: Conversion | None) -> str | None:
    """Why a conversion cannot be applied, or None if it can."""
    if conversion is None:
        return None
    if conversion.kind == "formula":
        try:
            Formula(conversion.formula)
        except LogError as error:
            return error.line()
    nested = {c.kind for c in _nested(conversion)}
    if "formula" in nested:
        return "conversion table with a formula in it is not supported"
    if "ranges" in nested:
        return "conversion table with a table of ranges in it is not supported"
    if conversion.kind in ("exponential", "logarithmic") and conversion.numbers[3] and conversion.numbers[0]:
        return f"{conversion.kind} conversion with two factors is not defined"
    return None


def _nested(conversion: Conversion) -> list[Conversion]:
    """Conversions inside a table, for the values that are numbers."""
    found: list[Conversion] = []
    pending = [conversion]
    while pending:
        inner = [c for c in pending.pop().references if isinstance(c, Conversion)]
        found += inner
        pending += inner
    return found


def physical(conversion: Conversion | None, raw: _Array, *, is_free: bool = False) -> FloatArray:
    """Apply a conversion that `refusal` has no objection to, in double precision.

    A table of texts leaves the number as it is; where some entries are texts (`error`) and the others numbers, a
    sample that is a text is NaN. `is_free`: nobody needs the raw samples any more, which may be changed.
    """
    if conversion is None:
        return raw.astype(np.float64, copy=False)
    if conversion.kind == "ranges":
        return _of_ranges(conversion, raw)
    if conversion.kind in ("texts", "texts of ranges"):
        return _of_texts(conversion, raw) if _nested(conversion) else raw.astype(np.float64)
    x = raw.astype(np.float64, copy=not is_free)
    return np.asarray(converted(conversion, x, into=x), dtype=np.float64)


def takes_floats(conversion: Conversion | None) -> bool:
    """Whether raw samples may become float64 before `physical`: a table asks for the numbers as the file has them."""
    return conversion is None or conversion.kind not in ("ranges", "texts", "texts of ranges")


def converted(conversion: Conversion, x: _Array, into: _Array | None = None) -> _Array:
    """Apply a conversion by a formula or between points, in the precision of the samples.

    `into`: where the values may stand, which may be the samples; fresh memory costs more than a line.
    """
    p = conversion.numbers
    match conversion.kind:
        case "linear":
            if (p[1], p[0]) == (1, 0):
                return x
            y = np.multiply(x, p[1], out=into)
            return np.add(y, p[0], out=y) if p[0] else y
        case "rational":
            return _rational(p, x)
        case "polynomial":
            y = x - p[4] - p[5]
            if (p[1], p[2], p[4], p[5]) == (0, 0, 0, 0):
                return x if p[0] == p[3] else p[3] * x / p[0]
            return (p[1] - p[3] * y) / (p[2] * y - p[0])
        case "exponential" | "logarithmic":
            function = np.exp if conversion.kind == "exponential" else np.log
            if p[3] == 0:
                return function(((x - p[6]) * p[5] - p[2]) / p[0]) / p[1]
            return function((p[2] / (x - p[6]) - p[5]) / p[3]) / p[4]
        case "formula":
            return Formula(conversion.formula)(x)
        case "interpolated":
            return np.interp(x, p[::2], p[1::2])
        case "nearest":
            return _nearest(np.array(p[::2]), np.array(p[1::2]), x)
    return x


def _rational(p: tuple[float, ...], x: _Array) -> _Array:
    if (p[0], p[2], p[3], p[4]) == (0, 0, 0, 0):
        return x if p[1] == p[5] else x * (p[1] / p[5])
    if (p[1], p[2], p[3], p[5]) == (0, 0, 0, 0):
        return x if p[0] == p[4] else x * (p[0] / p[4])
    return (p[0] * x**2 + p[1] * x + p[2]) / (p[3] * x**2 + p[4] * x + p[5])


def _nearest(raw: _Array, values: _Array, x: _Array) -> _Array:
    """Value of the nearest point; of two that are as near the lower one."""
    above = np.minimum(np.searchsorted(raw, x), len(raw) - 1)
    below = np.maximum(above - 1, 0)
    return np.where(np.abs(x - raw[above]) >= np.abs(x - raw[below]), values[below], values[above])


def _of_ranges(conversion: Conversion, raw: _Array) -> FloatArray:
    """Values of a table of ranges: whole numbers belong to both ends of a range, others to its lower end only."""
    *table, default = conversion.numbers
    found: FloatArray = np.full(raw.shape, default)
    is_free = np.ones(raw.shape, dtype=np.bool_)
    for low, high, value in zip(table[::3], table[1::3], table[2::3], strict=True):
        here = is_free & _is_between(raw, low, high)
        found[here] = value
        is_free &= ~here
    return found


def _of_texts(conversion: Conversion, raw: _Array) -> FloatArray:
    """Values of a table some of whose entries are conversions; NaN for texts."""
    p = conversion.numbers
    keys = list(zip(p[::2], p[1::2], strict=True)) if conversion.kind == "texts of ranges" else [(v, v) for v in p]
    *entries, default = conversion.references
    found: FloatArray = np.full(raw.shape, np.nan)
    is_free = np.ones(raw.shape, dtype=np.bool_)
    for (low, high), entry in sorted(zip(keys, entries, strict=True), key=lambda pair: pair[0]):
        here = is_free & (raw == low if conversion.kind == "texts" else _is_between(raw, low, high))
        if isinstance(entry, Conversion):
            found[here] = physical(entry, raw[here])
        is_free &= ~here
    if not isinstance(default, bytes):
        found[is_free] = physical(default, raw[is_free])
    return found


def _is_between(raw: _Array, low: float, high: float) -> BoolArray:
    return np.asarray((raw >= low) & ((raw < high) if raw.dtype.kind == "f" else (raw <= high)))
