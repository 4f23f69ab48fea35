"""Arrays of any kind as arrays of numpy."""

from __future__ import annotations

import operator
from typing import Any, Optional

import numpy as np

from ._errors import NoMemoryError, UsageError

#: Copies of fewer bytes are made without a look at the free memory.
_SMALL = 1 << 28


def array(name: str, value: Any) -> np.ndarray:
    """Returns ``value`` as an array, without a copy where its memory can be shared.

    Taken are arrays of numpy, objects with ``__array_interface__`` or the buffer protocol,
    sequences, and tensors on the host by DLPack.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise UsageError(f"{name}: some numbers are masked: leave their rows out, or fill them")
    if isinstance(value, np.ndarray):
        return np.asarray(value)
    if not hasattr(value, "__array_interface__") and hasattr(value, "__dlpack__"):
        try:
            return np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError, ValueError) as error:
            raise UsageError(f"{name}: the tensor cannot be shared, move it to the host first: {error}") from None
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name}: it is no array of numbers: {error}") from None


def _free() -> float:
    """Returns the bytes of memory that the system has free, or inf where it does not tell."""
    try:
        with open("/proc/meminfo") as file:
            lines = dict(line.split(":", 1) for line in file)
        return 1024.0 * int(lines["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        return float("inf")


def _converted(name: str, numbers: np.ndarray, dtype: Any) -> np.ndarray:
    """Returns a copy of ``numbers`` of another type; arrays may claim more rows than memory has."""
    size = numbers.size * np.dtype(dtype).itemsize
    try:
        if size < _SMALL or size < _free():
            return numbers.astype(dtype)
    except MemoryError:
        pass
    needed = (size + (1 << 20) - 1) >> 20
    raise NoMemoryError(f"the system has no memory for a copy of {name}: about {needed} MiB are needed")


def _shared(numbers: np.ndarray, *types: Any) -> bool:
    """Whether the compiled part can read the memory: fields of packed records are not aligned."""
    is_whole = all(stride % numbers.itemsize == 0 for stride in numbers.strides)
    return numbers.dtype in types and numbers.dtype.isnative and numbers.flags.aligned and is_whole


def _check_rows(name: str, numbers: np.ndarray, rows: Optional[int]) -> None:
    if rows is not None and numbers.shape[:1] != (rows,):
        raise UsageError(f"{name}: the shape is {numbers.shape}, and {rows} rows are needed")


def floats(name: str, value: Any, rows: Optional[int] = None) -> np.ndarray:
    """Returns ``value`` as an array of float32 or float64, in the byte order of the machine.

    An array of another number of ``rows`` is refused before it is copied.
    """
    numbers = array(name, value)
    _check_rows(name, numbers, rows)
    if _shared(numbers, np.float32, np.float64):
        return numbers
    if numbers.dtype.kind not in "iuf":
        raise UsageError(f"{name}: an array of numbers is needed, not of {numbers.dtype}")
    is_single = numbers.dtype.kind == "f" and numbers.dtype.itemsize <= 4
    return _converted(name, numbers, np.float32 if is_single else np.float64)


def light(name: str, value: Any, rows: int) -> np.ndarray:
    """Returns linear light or alphas, which are floats: integers would have another meaning."""
    numbers = array(name, value)
    if numbers.dtype.kind in "iu":
        raise UsageError(f"{name}: the numbers are integers, {numbers.dtype}, and floats from 0 to 1 are needed")
    return floats(name, numbers, rows)


def colors(name: str, value: Any, rows: int) -> np.ndarray:
    """Returns colours: uint8 are sRGB codes, floats are linear light."""
    numbers = array(name, value)
    if numbers.dtype == np.uint8:
        _check_rows(name, numbers, rows)
        return numbers
    if numbers.dtype.kind in "iu":
        raise UsageError(
            f"{name}: integers are sRGB codes of uint8, not {numbers.dtype}: convert them, such as "
            "(colors >> 8).astype(np.uint8) for codes of 16 bits"
        )
    return floats(name, numbers, rows)


def indices(name: str, value: Any) -> np.ndarray:
    """Returns ``value`` as an array of int64."""
    numbers = array(name, value)
    if numbers.dtype.kind not in "iu":
        raise UsageError(f"{name}: an array of integers is needed, not of {numbers.dtype}")
    return numbers if _shared(numbers, np.int64) else _converted(name, numbers, np.int64)


def whole(name: str, value: Any, least: int, most: int) -> int:
    """Returns a whole number between ``least`` and ``most``."""
    try:
        number = operator.index(value)
    except TypeError:
        raise UsageError(f"{name}: a whole number is needed, not {value!r}") from None
    if not least <= number <= most:
        raise UsageError(f"{name}: it lies between {least} and {most}, and {number} does not")
    return number
