"""Cameras: x right, y down, z forward (OpenCV). The centre of pixel (i, j) is (i + 0.5, j + 0.5)."""

from __future__ import annotations

import os
from typing import Any, List, Optional, Tuple, Union

import numpy as np

from . import _arrays, _epsplat
from ._errors import UsageError


class View:
    """A camera by options of the command line, such as ``View(from_="iso", fov=30)``.

    Values that are not given come from the scene and the renderer: without an eye the view shows the
    whole scene.

    Parameters
    ----------
    options
        Options of ``epsplat render`` for cameras: eye, target, up (each x, y, z), from_ (or view),
        azimuth, elevation, fov (degrees; vertical, of a fisheye horizontal), ortho (a height in world units, or True),
        projection, intrinsics (fx, fy, cx, cy in pixels), size (width, height), near, camera (the
        path of a camera file).
    """

    def __init__(self, **options: Any):
        self._view = _epsplat.View.of_options(options)

    @classmethod
    def _of(cls, view: _epsplat.View) -> "View":
        made = cls.__new__(cls)
        made._view = view
        return made

    @property
    def name(self) -> str:
        """The name of its picture in a file of cameras, or the options."""
        return self._view.name

    def __repr__(self) -> str:
        return f"<epsplat.View {self.name}>"


def look_at(eye: Any, target: Any, up: Any = None, fov: Optional[float] = None, **options: Any) -> View:
    """Returns the view from ``eye`` to ``target`` (each x, y, z in world coordinates).

    Parameters
    ----------
    up : world direction that is up in the picture; the scene's by default
    fov : vertical field of view, degrees; 45 by default
    options : those of :class:`View`, such as ``ortho`` or ``near``
    """
    return View(eye=eye, target=target, up=up, fov=fov, **options)


#: Camera axes of OpenGL (x right, y up, z back) in those of OpenCV.
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def views(viewmats: Any, Ks: Any, convention: str = "opencv") -> List[View]:
    """Returns views of world-to-camera matrices and intrinsics, as in gsplat.

    Parameters
    ----------
    viewmats : (C, 4, 4) or (4, 4), world to camera
    Ks : (C, 3, 3) or (3, 3), pixels
        ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``; one matrix serves all views.
    convention : "opencv" (x right, y down, z forward) or "opengl" (x right, y up, z back)

    Raises
    ------
    UsageError
        For a wrong shape, a matrix that is no rotation, or intrinsics with skew.
    """
    if convention not in ("opencv", "opengl"):
        raise UsageError(f"convention: it is 'opencv' or 'opengl', not {convention!r}")
    poses, intrinsics = _arrays.floats("viewmats", viewmats), _arrays.floats("Ks", Ks)
    poses = poses[None] if poses.ndim == 2 else poses
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise UsageError(f"viewmats: the shape is {poses.shape}, and (C, 4, 4) is needed")
    if intrinsics.shape == (3, 3):
        intrinsics = np.broadcast_to(intrinsics, (len(poses), 3, 3))
    if intrinsics.shape != (len(poses), 3, 3):
        raise UsageError(f"Ks: the shape is {intrinsics.shape}, and ({len(poses)}, 3, 3) is needed")
    poses = _OPENGL @ poses if convention == "opengl" else poses
    made = _epsplat.View.of_matrices(poses.reshape(-1, 16), intrinsics.reshape(-1, 9))
    return [View._of(view) for view in made]


def cameras(
    path: Union[str, "os.PathLike[str]"],
    size: Tuple[int, int] = (1024, 1024),
    scale: Optional[float] = None,
    ignore_distortion: bool = False,
) -> List[View]:
    """Reads the cameras of COLMAP's folder, a transforms.json, a cameras.json or a camera path.

    Parameters
    ----------
    size : (width, height), pixels
        For cameras whose file gives none.
    scale : factor of the width and height of the pictures, and of the intrinsics
    ignore_distortion : render pinholes with the same focal lengths

    Returns
    -------
    list of View, whose ``name`` is that of its photograph without the extension
    """
    width, height = (_arrays.whole("size", side, 1, 2**32 - 1) for side in size)
    made = _epsplat.View.of_file(os.fspath(path), (width, height), scale, ignore_distortion)
    return [View._of(view) for view in made]
