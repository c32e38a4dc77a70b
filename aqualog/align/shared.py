"""Work out once what the channels of one group share, above all their time stamps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

__all__ = ["OfLast"]

_Value = TypeVar("_Value")


class OfLast(Generic[_Value]):
    """A function of an array that is called repeatedly with the same object; the last answer is kept.

    Parameters
    ----------
    function : callable
        Function of one array, which must not change in between.
    """

    def __init__(self, function: Callable[[NDArray[Any]], _Value]) -> None:
        self._function = function
        self._last: tuple[NDArray[Any], _Value] | None = None

    def __call__(self, array: NDArray[Any]) -> _Value:
        """Return the answer for this array, from before if it is the same object."""
        if self._last is None or self._last[0] is not array:
            self._last = (array, self._function(array))
        return self._last[1]
