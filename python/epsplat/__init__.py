"""Headless rendering of surfels, point clouds, meshes and Gaussians into numpy arrays.

    import epsplat

    scene = epsplat.read("scan.laz")
    frames = epsplat.Renderer(scene, width=1920, height=1080, aov=["depth", "normal"]).render()
    frames.color   # (C, H, W, 4) float32, linear light with straight alpha
    frames.depth   # (C, H, W) float32, world units along the camera's axis; inf where nothing is

Options are those of the command line ``epsplat render``, by the same names: ``--epsilon rel:0.01``
is ``epsilon="rel:0.01"``, and ``--color-by z`` is ``color_by="z"``. A list is a list, a switch is
True. ``--from`` is ``from_`` or ``view``, as ``from`` is a word of Python.

No display is needed. Kernels run on the best adapter; without one, the f64 reference renders.
"""

from ._clouds import coverage, lod, sample, simplify, surfels, visible
from ._epsplat import __version__
from ._errors import (
    DeviceError,
    EmptySceneError,
    Error,
    FileError,
    MalformedError,
    MissingFileError,
    NoMemoryError,
    StudyError,
    UsageError,
)
from ._frames import Frames
from ._research import compare, error_map, study
from ._renderer import Renderer, merge, picture
from ._scene import Scene, read
from ._view import View, cameras, look_at, views

__all__ = [
    "DeviceError",
    "EmptySceneError",
    "Error",
    "FileError",
    "Frames",
    "MalformedError",
    "MissingFileError",
    "NoMemoryError",
    "Renderer",
    "Scene",
    "StudyError",
    "UsageError",
    "View",
    "__version__",
    "cameras",
    "compare",
    "coverage",
    "error_map",
    "lod",
    "look_at",
    "merge",
    "picture",
    "read",
    "sample",
    "simplify",
    "study",
    "surfels",
    "views",
    "visible",
]
