"""Progress of long calls."""

from __future__ import annotations

from typing import Any, Callable, Optional


class Stages:
    """Passes stages to a class such as ``tqdm.tqdm``, or to a function.

    A class with a method ``update`` makes a bar for each stage: ``progress(total=units, desc=what)``,
    ``bar.update(n)``, ``bar.close()``. A function is called as ``progress(what, done, units)``; units
    are 0 where their number is not known.
    """

    def __init__(self, progress: Callable[..., Any]):
        self._progress = progress
        self._makes_bars = hasattr(progress, "update")
        self._bar: Any = None
        self._stage = ("", 0, 0)

    def begin(self, what: str, units: int) -> None:
        self._stage = (what, 0, units)
        if self._makes_bars:
            self._close()
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
        self._close()

    def note(self, line: str) -> None:
        """Notes are in the result."""

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def stages(progress: Optional[Callable[..., Any]]) -> Optional[Stages]:
    return None if progress is None else Stages(progress)
