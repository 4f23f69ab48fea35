"""Progress of long calls."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any, Callable, Iterator, Optional


class Stages:
    """Passes stages to a class such as ``tqdm.tqdm``, or to a function.

    A class with a method ``update``, or a ``functools.partial`` of one, makes a bar for each stage:
    ``progress(total=units, desc=what)``, ``bar.update(n)``, ``bar.close()``. A function is called as
    ``progress(what, done, units)``; units are 0 where their number is not known.
    """

    def __init__(self, progress: Callable[..., Any]):
        self._progress = progress
        self._makes_bars = hasattr(getattr(progress, "func", progress), "update")
        self._bar: Any = None
        self._stage = ("", 0, 0)

    def begin(self, what: str, units: int) -> None:
        self._stage = (what, 0, units)
        if self._makes_bars:
            self.close()
            self._bar = self._progress(total=units or None, desc=what)
        else:
            self._progress(*self._stage)

    def advance(self, units: int) -> None:
        what, done, all_units = self._stage
        self._stage = (what, done + units, all_units)
        if self._bar is not None:
            self._bar.update(units)
        elif not self._makes_bars:
            self._progress(*self._stage)

    def end(self) -> None:
        self.close()

    def note(self, line: str) -> None:
        """Notes are in the result."""

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextmanager
def stages(progress: Optional[Callable[..., Any]]) -> Iterator[Optional[Stages]]:
    """Makes stages for one call. A bar that is open when the call fails is closed."""
    made = None if progress is None else Stages(progress)
    try:
        yield made
    finally:
        if made is not None:
            made.close()
