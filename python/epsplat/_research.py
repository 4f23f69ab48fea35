"""Errors of pictures, and studies of speed beside error."""

from __future__ import annotations

import json
import os
from typing import Any, Callable, Dict, List, Optional

import numpy as np

from . import _arrays, _epsplat
from ._adapter import opening
from ._errors import StudyError, UsageError
from ._frames import Frames
from ._progress import stages
from ._scene import Path


def compare(frames: Frames, exact: Frames, index: int = 0) -> Dict[str, Any]:
    """Measures the error of a picture against one that counts as exact.

    Returns
    -------
    dict, as ``epsplat compare --json`` writes it
        max_abs, rmse and psnr_db (None for equal pictures) of the linear colour, and for each map
        that both have its range and largest difference.
    """
    return json.loads(_epsplat.compare(*frames._picture(index), *exact._picture(index)))


def error_map(frames: Frames, exact: Frames, name: str = "color") -> np.ndarray:
    """Returns the largest absolute difference of each pixel: (C, H, W) float64.

    A pixel with a value in one picture only (infinite depths elsewhere) has the error inf.
    """
    for of in (frames, exact):
        if name != "color" and name not in of.maps:
            raise UsageError(f"there is no map {name}: the frames have {', '.join(['color', *of.maps])}")
    one, other = (of.color if name == "color" else of.maps[name] for of in (frames, exact))
    if one.shape != other.shape:
        raise UsageError(f"pictures of one size are compared, and these have the shapes {one.shape} and {other.shape}")
    one, other = one.astype(np.float64), other.astype(np.float64)
    with np.errstate(invalid="ignore"):
        error = np.where(one == other, 0.0, np.abs(one - other))
    return error.max(axis=-1) if error.ndim == 4 else error


def study(
    definition: Path,
    *,
    quick: bool = False,
    runs: Optional[int] = None,
    adapter: Optional[str] = None,
    out: Optional[Path] = None,
    strict: bool = True,
    progress: Optional[Callable[..., Any]] = None,
) -> List[Dict[str, Any]]:
    """Runs a study: every configuration on every scene of a TOML file.

    Parameters
    ----------
    quick : the definition's quick form, which takes some seconds
    runs : number of timed runs of each configuration
    out : a folder for the report: index.html, results.csv, results.json
    strict : raise StudyError if a configuration misses its error limit; it has the rows

    Returns
    -------
    list of dict
        One row for each configuration on each scene; ``pandas.json_normalize`` makes a table of it.
    """
    path, folder = os.fspath(definition), None if out is None else os.fspath(out)
    runs = None if runs is None else _arrays.whole("runs", runs, 1, 10_000)
    with stages(progress) as shown, opening():
        rows, machine, _, failures = _epsplat.study(path, quick, runs, adapter, folder, shown)
    about = json.loads(machine)
    table = [{**row, "machine": about} for row in json.loads(rows)]
    if strict and failures:
        error = StudyError(f"the study {path} failed: {'; '.join(failures)}")
        error.rows = table
        raise error
    return table
