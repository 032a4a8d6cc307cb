"""Checks of arguments, whose messages name them."""

from operator import index
from typing import SupportsIndex


def whole(name: str, value: SupportsIndex) -> int:
    """The value of an argument that must be an integer, of Python or NumPy."""
    try:
        return index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, but is {value!r}") from None


def count(name: str, value: SupportsIndex | None) -> int | None:
    """The same for integers that are not negative; None stands for itself."""
    if value is None:
        return None
    number = whole(name, value)
    if not 0 <= number < 1 << 64:
        raise ValueError(f"{name} must lie between 0 and 2^64 - 1, but is {number}")
    return number
