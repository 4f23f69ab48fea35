"""Arrays of any kind as arrays of numpy."""

from __future__ import annotations

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
    if isinstance(value, np.ndarray):
        return value
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


def floats(name: str, value: Any, rows: Optional[int] = None) -> np.ndarray:
    """Returns ``value`` as an array of float32 or float64, in the byte order of the machine.

    An array of another number of ``rows`` is refused before it is copied.
    """
    numbers = array(name, value)
    if rows is not None and numbers.shape[:1] != (rows,):
        raise UsageError(f"{name}: the shape is {numbers.shape}, and {rows} rows are needed")
    if numbers.dtype in (np.float32, np.float64) and numbers.dtype.isnative:
        return numbers
    if numbers.dtype.kind not in "iuf":
        raise UsageError(f"{name}: an array of numbers is needed, not of {numbers.dtype}")
    return _converted(name, numbers, np.float32 if numbers.dtype == np.float16 else np.float64)


def colors(name: str, value: Any, rows: int) -> np.ndarray:
    """Returns colours: uint8 stay as they are, other numbers become floats."""
    numbers = array(name, value)
    return numbers if numbers.dtype == np.uint8 else floats(name, numbers, rows)


def indices(name: str, value: Any) -> np.ndarray:
    """Returns ``value`` as an array of int64."""
    numbers = array(name, value)
    if numbers.dtype.kind not in "iu":
        raise UsageError(f"{name}: an array of integers is needed, not of {numbers.dtype}")
    return numbers if numbers.dtype == np.int64 and numbers.dtype.isnative else _converted(name, numbers, np.int64)
