"""Errors of pictures, and studies of speed beside error."""

from __future__ import annotations

import json
import os
from typing import Any, Callable, Dict, List, Optional

import numpy as np

from . import _epsplat
from ._errors import StudyError
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

    def parts(of: Frames) -> Any:
        return of.color[index], {name: values[index] for name, values in of.maps.items()}

    return json.loads(_epsplat.compare(*parts(frames), *parts(exact)))


def error_map(frames: Frames, exact: Frames, name: str = "color") -> np.ndarray:
    """Returns the largest absolute difference of each pixel: (C, H, W) float64.

    A pixel with a value in one picture only (infinite depths elsewhere) has the error inf.
    """
    one, other = (of.color if name == "color" else of.maps[name] for of in (frames, exact))
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
    strict : raise StudyError if a configuration misses its error limit

    Returns
    -------
    list of dict
        One row for each configuration on each scene; ``pandas.json_normalize`` makes a table of it.
    """
    path, folder = os.fspath(definition), None if out is None else os.fspath(out)
    rows, machine, _, failures = _epsplat.study(path, quick, runs, adapter, folder, stages(progress))
    if strict and failures:
        raise StudyError("; ".join(failures))
    about = json.loads(machine)
    return [{**row, "machine": about} for row in json.loads(rows)]
