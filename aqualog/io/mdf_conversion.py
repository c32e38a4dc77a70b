"""Convert the raw samples of an MDF channel to physical numbers.

Algebraic conversions are text in the file. asammdf passes the text to sympy, which executes it. It silently returns the
raw samples where it cannot parse the text. Here such text is parsed against an allow-list of arithmetic; all else is
refused.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import FloatArray

__all__ = ["Formula", "formula_text", "is_text_only", "physical", "refusal"]

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


# Numbers of the conversion types, MDF 4 and MDF 3 (the two versions disagree).
_V4_ALGEBRAIC, _V4_VALUE_TO_TEXT, _V4_RANGE_TO_TEXT = 3, 7, 8
_V4_NEEDS_TEXT = (9, 10)  # text to value, text to text
_V4_BITFIELD = 11
_V4_BY_VALUE = (1, 2, 4, 5)  # linear, rational, tables with and without interpolation
_V4_RANGE_TO_VALUE = 6
_V3_ALGEBRAIC, _V3_VALUE_TO_TEXT = 10, 11


def formula_text(conversion: Any, *, version4: bool) -> str | None:
    """The formula of an algebraic conversion, or None."""
    if conversion is None or conversion.conversion_type != (_V4_ALGEBRAIC if version4 else _V3_ALGEBRAIC):
        return None
    if version4:
        return str(conversion.formula)
    # asammdf's own decoding of the MDF 3 text turns every x into X, also that of exp
    return str(conversion.formula_field.split(b"\0")[0].decode("latin-1"))


def is_text_only(conversion: Any, *, version4: bool) -> bool:
    """Whether the conversion takes text, so that there is no number."""
    return conversion is not None and version4 and conversion.conversion_type in _V4_NEEDS_TEXT


def refusal(conversion: Any, *, version4: bool) -> str | None:
    """Why a conversion cannot be applied, or None if it can."""
    text = formula_text(conversion, version4=version4)
    if text is not None:
        try:
            Formula(text)
        except LogError as error:
            return error.line()
    nested = _nested(conversion, version4=version4)
    if any(formula_text(c, version4=True) is not None for c in nested):
        return "conversion table with a formula in it is not supported"
    if any(c.conversion_type == _V4_RANGE_TO_VALUE for c in nested):
        return "conversion table with a table of ranges in it is not supported"
    return None


def _nested(conversion: Any, *, version4: bool) -> list[Any]:
    """Conversions inside a value-to-text table, for the values that are numbers."""
    if not version4 or conversion is None or not conversion.referenced_blocks:
        return []
    found: list[Any] = []
    pending = [conversion]
    while pending and len(found) < 10_000:  # a file may link a table to itself
        blocks = pending.pop().referenced_blocks or {}
        inner = [b for b in blocks.values() if b is not None and not isinstance(b, (bytes, str))]
        found += inner
        pending += inner
    return found


def physical(conversion: Any, raw: _Array, *, version4: bool) -> FloatArray:
    """Apply a conversion that `refusal` has no objection to.

    A table of texts leaves the number as it is; where some entries are texts (`error`) and the others numbers, a
    sample that is a text is NaN.
    """
    if conversion is None:
        return raw.astype(np.float64)
    text = formula_text(conversion, version4=version4)
    if text is not None:
        return Formula(text)(raw)
    if version4:
        return _physical4(conversion, raw)
    if conversion.conversion_type == _V3_VALUE_TO_TEXT:
        return raw.astype(np.float64)
    # the keyword spares only the range-to-text type; the numeric types of MDF 3 ignore it
    return _numbers(conversion.convert(raw.astype(np.float64), ignore_value2text_conversions=True), raw)


def _physical4(conversion: Any, raw: _Array) -> FloatArray:
    kind = conversion.conversion_type
    if kind in (_V4_VALUE_TO_TEXT, _V4_RANGE_TO_TEXT):
        if not _nested(conversion, version4=True):
            return raw.astype(np.float64)
        return _numbers(conversion.convert(raw), raw)
    if kind == _V4_BITFIELD:
        return raw.astype(np.float64)
    if kind == _V4_RANGE_TO_VALUE:
        return _of_ranges(conversion, raw)
    # float64 first: asammdf would scale float32 samples in float32
    return _numbers(conversion.convert(raw.astype(np.float64) if kind in _V4_BY_VALUE else raw), raw)


def _of_ranges(conversion: Any, raw: _Array) -> FloatArray:
    """Values of a table of ranges: whole numbers belong to both ends of a range, others to its lower end only.

    asammdf gives whole numbers inside a range the default.
    """
    found: FloatArray = np.full(raw.shape, float(conversion.default))
    is_free = np.ones(raw.shape, dtype=np.bool_)
    for i in range((conversion.val_param_nr - 1) // 3):
        low, high = conversion[f"lower_{i}"], conversion[f"upper_{i}"]
        here = is_free & (raw >= low) & ((raw < high) if raw.dtype.kind == "f" else (raw <= high))
        found[here] = conversion[f"phys_{i}"]
        is_free &= ~here
    return found


def _numbers(converted: _Array, raw: _Array) -> FloatArray:
    if converted.dtype.kind in "SU":  # every sample was a text
        return np.full(raw.shape, np.nan)
    if converted.dtype.kind == "O":
        return np.array([np.nan if isinstance(v, (bytes, str)) else float(v) for v in converted], dtype=np.float64)
    return np.asarray(converted, dtype=np.float64)
