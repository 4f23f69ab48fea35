"""Functions of clouds, each of which does what the command of its name does."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _arrays, _epsplat
from ._adapter import opening
from ._progress import stages
from ._scene import Path, Scene, read
from ._view import View

Progress = Optional[Callable[..., Any]]
Source = Union[Scene, Path]


def _scene(source: Source) -> _epsplat.Scene:
    return (source if isinstance(source, Scene) else read(source))._scene


def _made(made: Tuple[_epsplat.Scene, str, List[str]]) -> Scene:
    scene = Scene._of(made[0])
    scene.report, scene.notes = json.loads(made[1]), made[2]
    return scene


def _texts(value: Any) -> List[str]:
    """Returns one orientation or several as texts: propagate, up, or positions of scanners."""
    if isinstance(value, str):
        return [value]
    rows = np.asarray(value, dtype=object)
    rows = rows[None] if rows.ndim == 1 and not isinstance(rows[0], str) else rows
    return [row if isinstance(row, str) else ",".join(repr(float(x)) for x in row) for row in rows]


def surfels(
    source: Source,
    *,
    size: str = "knn",
    orient: Any = "propagate",
    estimate_normals: bool = False,
    progress: Progress = None,
    **limits: Any,
) -> Scene:
    """Makes surfels from points: oriented normals, ellipses without gaps.

    Parameters
    ----------
    source : a Scene, whose inputs are joined, or a path
    size : "knn", "ellipse", "bsp", "bsp:RULE" or "qsplat"
    orient : "propagate", "up", or the position (x, y, z) of a scanner, or of several (S, 3)
    estimate_normals : estimate also the normals that are given
    limits : outliers, max_radius and flat, as on the command line

    Returns
    -------
    Scene
        Its :meth:`~Scene.arrays` are the surfels; ``report`` has their number.
    """
    with stages(progress) as shown:
        return _made(_epsplat.surfels(_scene(source), size, _texts(orient), estimate_normals, limits, shown))


def sample(
    mesh: Source,
    count: int,
    *,
    priority: str = "triangles",
    method: str = "stratified",
    shape: str = "disk",
    depth: Optional[int] = None,
    seed: int = 0,
    progress: Progress = None,
) -> Scene:
    """Covers a mesh with ``count`` surfels.

    Parameters
    ----------
    mesh : the path of a mesh, or a Scene of one file or of arrays with triangles
    priority : "triangles", "touched", "area", "curvature" or "texture"
    method : "stratified", "projected" or "uniform"
    shape : "disk" or "cap"
    depth : halvings of the mesh's box into voxels
    """
    count, seed = _arrays.whole("count", count, 1, 2**32 - 1), _arrays.whole("seed", seed, 0, 2**64 - 1)
    depth = None if depth is None else _arrays.whole("depth", depth, 0, 2**32 - 1)
    with stages(progress) as shown:
        return _made(_epsplat.sample(_scene(mesh), count, priority, method, shape, depth, seed, shown))


def simplify(
    source: Source,
    *,
    tolerance: Union[str, float] = "rel:0.0005",
    shape: str = "disk",
    relax: int = 0,
    progress: Progress = None,
) -> Scene:
    """Replaces surfels by fewer, larger ones within a tolerance, without holes.

    Parameters
    ----------
    tolerance : "rel:E" (of the diagonal of the box), "abs:E", or a number of world units
    shape : "disk", "ellipse" or "cap"
    relax : rounds in which surfels move so that fewer are needed

    Returns
    -------
    Scene
        Its ``report`` has the counts and deviations, world units.
    """
    text = tolerance if isinstance(tolerance, str) else f"abs:{float(tolerance)!r}"
    relax = _arrays.whole("relax", relax, 0, 2**32 - 1)
    with stages(progress) as shown:
        return _made(_epsplat.simplify(_scene(source), text, shape, relax, shown))


def lod(
    source: Source,
    output: Path,
    *,
    cut: Optional[float] = None,
    progress: Progress = None,
    **limits: Any,
) -> Dict[str, Any]:
    """Builds levels of detail for ``Renderer(lod=...)`` and writes them as PLY.

    Parameters
    ----------
    output : the file, which appears whole or not at all
    cut : a radius in world units; a cut of the tree is then written in its place
    limits : outliers, max_radius and flat, as on the command line

    Returns
    -------
    dict of the numbers of surfels, nodes and levels, and the notes
    """
    with stages(progress) as shown:
        counts, notes = _epsplat.lod(_scene(source), os.fspath(output), cut, limits, shown)
    return {**json.loads(counts), "notes": notes}


def coverage(
    source: Source, mesh: Source, *, views: int = 64, side: int = 512, progress: Progress = None
) -> Dict[str, Any]:
    """Measures holes between surfels that represent a mesh, and their distances from it.

    Parameters
    ----------
    views : number of directions that rays are cast from
    side : rays along each side of a direction's grid

    Returns
    -------
    dict, as ``epsplat coverage --json`` writes it, and the notes; distances in world units
    """
    views, side = _arrays.whole("views", views, 1, 65_536), _arrays.whole("side", side, 1, 8192)
    with stages(progress) as shown:
        measured, notes = _epsplat.coverage(_scene(source), _scene(mesh), views, side, shown)
    return {**json.loads(measured), "notes": notes}


def visible(
    source: Source,
    views: Union[View, Sequence[View]],
    *,
    progress: Progress = None,
    **options: Any,
) -> np.ndarray:
    """Counts the views that see each point.

    Parameters
    ----------
    source : a Scene or a path; the points of several inputs follow each other
    views : Views, such as those of :func:`epsplat.cameras` or :func:`epsplat.views`
    options : epsilon (the depth tolerance), size, backend, adapter

    Returns
    -------
    (N,) uint32
        ``points[visible(...) > 0]`` are the points that a view sees.
    """
    all_views = [views] if isinstance(views, View) else list(views)
    with stages(progress) as shown, opening():
        counts, _, notes = _epsplat.visible(_scene(source), [view._view for view in all_views], options, shown)
    for note in notes:
        if note.startswith("warning: "):
            warnings.warn(note[len("warning: ") :], stacklevel=2)
    return np.concatenate(counts) if counts else np.zeros(0, np.uint32)
