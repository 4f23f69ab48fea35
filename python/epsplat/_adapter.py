"""The environment of drivers."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from contextlib import contextmanager
from typing import Iterator

_VARIABLE = "XDG_RUNTIME_DIR"
_lock = threading.Lock()
_calls = 0


@contextmanager
def opening() -> Iterator[None]:
    """Keeps Mesa's drivers silent, which look for a display in a folder and print a line without it.

    The variable is there as long as a call may open an adapter.
    """
    global _calls
    if not sys.platform.startswith("linux"):
        yield
        return
    with _lock:
        if _calls > 0 or _VARIABLE not in os.environ:
            _calls += 1
            counted = True
            try:
                os.environ.setdefault(_VARIABLE, tempfile.gettempdir())
            except OSError:
                pass
        else:
            counted = False
    try:
        yield
    finally:
        if counted:
            with _lock:
                _calls -= 1
                if _calls == 0:
                    os.environ.pop(_VARIABLE, None)
