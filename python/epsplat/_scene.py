"""Scenes of files and of arrays."""

from __future__ import annotations

import os
from typing import Any, Iterable, Mapping, Optional, Sequence, Union

from . import _arrays, _epsplat

Path = Union[str, "os.PathLike[str]"]


class Scene:
    """Points in arrays, as a scene. :func:`read` makes scenes of files.

    Arrays are of numpy, or anything that shares its memory (``__array_interface__``, the buffer
    protocol, DLPack on the host); any strides, read-only too. The scene shares their memory and
    makes surfels of it when a renderer needs them: leave the numbers as they are. Numbers of other
    types are copied once. N is the number of points. Points with a coordinate that is not finite are
    left out, and the notes of a render count them.

    Parameters
    ----------
    positions : (N, 3) float64 or float32, world units
        Differences between positions keep their digits wherever the scene lies (UTM too).
    normals : (N, 3), of any length; 0 or nan where missing. Estimated without them.
    radii : (N,), world units; 0 or nan where missing. Estimated without them.
    half_axes : (N, 2, 3), world units
        The half-axes s and t of elliptical disks, with the normal s x t. They replace normals and
        radii.
    colors : (N, 3) or (N, 4)
        uint8: sRGB codes. Floats: linear light. The fourth is straight alpha.
    alpha : (N,) floats, 0 to 1
        Multiplies the alpha of the colours. It shows with ``composite="layers"`` or ``"sorted"``.
    texture : (N, 2)
        Texture coordinates (u, v), origin bottom left.
    triangles : (M, 3) integers
        Indices of positions; the points are then the vertices of a mesh.
    attributes : dict of (N,)
        Scalar attributes by name, for ``color_by="name"``.
    up : "y" or "z"
        The up direction of the data; guessed without it.
    options
        Options of ``epsplat render`` for scenes: color_by, color_map, range, surfel_size, outliers,
        smooth, mesh and others.

    Raises
    ------
    UsageError
        For a wrong shape or type, or options that do not exist or have a wrong value.
    """

    #: Counts of the function that made the scene: surfels, sample or simplify.
    report: Optional[dict] = None
    #: Notes of the function that made the scene.
    notes: Sequence[str] = ()

    def __init__(
        self,
        positions: Any,
        *,
        normals: Any = None,
        radii: Any = None,
        half_axes: Any = None,
        colors: Any = None,
        alpha: Any = None,
        texture: Any = None,
        triangles: Any = None,
        attributes: Optional[Mapping[str, Any]] = None,
        up: Optional[str] = None,
        **options: Any,
    ):
        points = _arrays.array("positions", positions)
        if points.ndim != 2 or points.shape[1] != 3:
            raise _arrays.UsageError(f"positions: the shape is {points.shape}, and (N, 3) is needed")
        points, rows = _arrays.floats("positions", points), len(points)
        given = {
            "normals": normals,
            "radii": radii,
            "half_axes": half_axes,
            "texture": texture,
        }
        if up not in (None, "y", "z"):
            raise _arrays.UsageError(f"up: it is 'y' or 'z', not {up!r}")
        arrays = {name: _arrays.floats(name, value, rows) for name, value in given.items() if value is not None}
        arrays["positions"] = points
        if colors is not None:
            arrays["colors"] = _arrays.colors("colors", colors, rows)
        if alpha is not None:
            arrays["alpha"] = _arrays.light("alpha", alpha, rows)
        if triangles is not None:
            arrays["triangles"] = _arrays.indices("triangles", triangles)
        arrays["attributes"] = {name: _arrays.floats(name, values, rows) for name, values in (attributes or {}).items()}
        arrays["up"] = up
        self._scene = _epsplat.Scene.of_arrays(arrays, options)

    @classmethod
    def _of(cls, scene: _epsplat.Scene) -> "Scene":
        made = cls.__new__(cls)
        made._scene = scene
        return made

    @property
    def files(self) -> list:
        """The files of the scene, including those found in folders."""
        return self._scene.files

    def inputs(self) -> list:
        """Returns the arrays of each input, a dict by name; files are read.

        positions (N, 3) float64, and where they are known normals (N, 3), radii (N,), half_axes
        (N, 2, 3), texture (N, 2) float32, colors (N, 4) as uint8 sRGB or float32 linear,
        triangles (M, 3) int64. ``Scene(**arrays)`` has the same points; the up direction of the
        format, clip lines and curvature of surfels, and the third half-axis of Gaussians are no
        arrays (:meth:`save` writes them). Colours of Gaussians become linear light.
        """
        return _epsplat.arrays(self._scene)

    def arrays(self) -> dict:
        """Returns the arrays of a scene with one input; see :meth:`inputs`."""
        inputs = self.inputs()
        if len(inputs) != 1:
            raise _arrays.UsageError(f"the scene has {len(inputs)} inputs: take inputs() for all of them")
        return inputs[0]

    def save(self, path: Path) -> None:
        """Writes the points of a scene with one input as PLY, which appears whole or not at all."""
        _epsplat.write(self._scene, os.fspath(path), None)

    def __len__(self) -> int:
        """The number of points of a scene of arrays."""
        if self._scene.points is None:
            raise TypeError("files are read by a renderer, so their number of points is not known")
        return self._scene.points

    def __bool__(self) -> bool:
        return True

    def __repr__(self) -> str:
        if self._scene.points is not None:
            return f"<epsplat.Scene of {self._scene.points} points in memory>"
        files = self.files
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        return f"<epsplat.Scene of {files[0] if files else 'no file'}{more}>"


def read(path: Union[Path, Iterable[Path]], **options: Any) -> Scene:
    """Opens a file, a folder, or several of them, which together make one scene.

    All formats of the command line are read: LAS, LAZ, COPC, E57, PLY, PCD, OBJ, glTF, STL, OFF, XYZ
    and Gaussians. A renderer reads the files when it needs them, and files with levels of detail only
    as far as a view needs them.

    Parameters
    ----------
    path : path, or an iterable of paths
    options
        Options of ``epsplat render`` for scenes: color_by, classes, where, surfel_size and others.

    Raises
    ------
    MissingFileError
        For a missing file; it is a FileError and a FileNotFoundError.
    UsageError
        For a folder without readable files, or a wrong option.
    """
    is_one = isinstance(path, (str, os.PathLike))
    paths = [path] if is_one else list(path)  # type: ignore[arg-type, list-item]
    return Scene._of(_epsplat.Scene.open([os.fspath(path) for path in paths], options))
