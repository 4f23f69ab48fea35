"""Arrays of any kind as arrays of numpy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._errors import UsageError


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


def floats(name: str, value: Any) -> np.ndarray:
    """Returns ``value`` as an array of float32 or float64, in the byte order of the machine."""
    numbers = array(name, value)
    if numbers.dtype in (np.float32, np.float64) and numbers.dtype.isnative:
        return numbers
    if numbers.dtype.kind not in "iuf":
        raise UsageError(f"{name}: an array of numbers is needed, not of {numbers.dtype}")
    return numbers.astype(np.float32 if numbers.dtype == np.float16 else np.float64)


def colors(name: str, value: Any) -> np.ndarray:
    """Returns colours: uint8 stay as they are, other numbers become floats."""
    numbers = array(name, value)
    return numbers if numbers.dtype == np.uint8 else floats(name, numbers)


def indices(name: str, value: Any) -> np.ndarray:
    """Returns ``value`` as an array of int64."""
    numbers = array(name, value)
    if numbers.dtype.kind not in "iu":
        raise UsageError(f"{name}: an array of integers is needed, not of {numbers.dtype}")
    return numbers.astype(np.int64, copy=False)
