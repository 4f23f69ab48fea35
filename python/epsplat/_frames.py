"""The result of a render."""

from __future__ import annotations

import json
import os
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

from . import _epsplat
from ._errors import UsageError
from ._view import View


def _exact(name: str, values: np.ndarray, dtype: Any) -> np.ndarray:
    """Returns values as a contiguous array of a type; users may have put others in the place."""
    try:
        return np.ascontiguousarray(values, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name}: it is no array of numbers: {error}") from None


class Frames:
    """C pictures of H rows and W columns. Each map is an attribute too: ``frames.depth``.

    Attributes
    ----------
    color : (C, H, W, 4) float32
        Linear light with straight alpha; alpha is 0 where nothing is.
    maps : dict of arrays by name
        depth (C, H, W): world units along the camera's axis, with a fisheye or a whole sphere from
        the eye; inf where nothing is.
        normal (C, H, W, 3): world space, of length 1; 0 where nothing is.
        height (C, H, W): world units along the up direction; -inf where nothing is.
        index (C, H, W, 2) uint32: the input and the point in it; 4294967295 where nothing is.
        weight, count, transmittance (1 where nothing is), layers, tail, decision: (C, H, W).
        texz (C, H, W, 3), surfaces (C, H, W, 16). The guide has all maps.
    views : list of View
        The cameras that were used, of any projection: render them again for the same picture.
    viewmats : (C, 4, 4) float64, world to camera, OpenCV axes
    Ks : (C, 3, 3) float64, pixels
        Of an orthographic view pixels per world unit, of a fisheye pixels per radian; these are no
        pinholes, and :attr:`views` has them whole. A map of more pixels than an image may have has
        no camera.
    reports : list of dict
        Times, counts and the adapter of each picture, as ``--json`` writes them.
    notes : list of str
        What the command line prints: choices, parts that were left out, warnings.
    unseen : list
        None, or a sentence that says why a picture is empty.
    extent : (xmin, xmax, ymin, ymax) of a map from above, world units; else None
    """

    def __init__(self, made: Dict[str, Any]):
        self.color: np.ndarray = made["color"]
        self.maps: Dict[str, np.ndarray] = made["maps"]
        self.viewmats: np.ndarray = made["viewmats"]
        self.Ks: np.ndarray = made["Ks"]
        self.views: List[View] = [View._of(view) for view in made["views"]]
        self.reports: List[Dict[str, Any]] = [json.loads(report) for report in made["reports"]]
        self.notes: List[str] = made["notes"]
        self.unseen: List[Optional[str]] = made["unseen"]
        self.extent: Optional[Tuple[float, float, float, float]] = None
        self._place = made.get("place")
        if self._place is not None:
            _, height, width, _ = self.color.shape
            left, top, pixel = made["left"], made["top"], made["pixel"]
            self.extent = (left, left + width * pixel, top - height * pixel, top)

    def __getattr__(self, name: str) -> np.ndarray:
        maps = self.__dict__.get("maps", {})
        if name in maps:
            return maps[name]
        raise AttributeError(f"the frames have no {name}: give aov to the renderer for a map")

    def __dir__(self) -> List[str]:
        return [*super().__dir__(), *self.maps]

    def __len__(self) -> int:
        """The number of pictures."""
        return len(self.color)

    def _picture(self, index: int) -> Tuple[np.ndarray, Dict[str, np.ndarray]]:
        """Returns the colour and the maps of a picture as the compiled part takes them."""
        whole = {name: np.uint32 for name in self.maps if self.maps[name].dtype.kind == "u"}
        maps = {name: _exact(name, values[index], whole.get(name, np.float32)) for name, values in self.maps.items()}
        return _exact("color", self.color[index], np.float32), maps

    def png(self, index: int = 0) -> bytes:
        """Returns a picture as PNG: 8-bit sRGB, straight alpha."""
        return _epsplat.encode(self._picture(index)[0], "png")

    def save(
        self, path: Union[str, "os.PathLike[str]"], index: int = 0, depth_scale: Optional[float] = None
    ) -> None:
        """Writes a picture. Its extension is that of a format of the command line.

        .png, .jpg: the colour. .exr, .npz: the colour and all maps. .npy, .tif: the only map, or the
        colour. The file appears whole or not at all. A map from above keeps its place: .tif in its
        tags, .png and .jpg in a world file.
        """
        color, maps = self._picture(index)
        if os.fspath(path).lower().endswith((".png", ".jpg", ".jpeg")) and depth_scale is None:
            maps = {}
        _epsplat.save(os.fspath(path), color, maps, depth_scale, self._place)

    def rgb(self, background: Tuple[float, float, float] = (1.0, 1.0, 1.0)) -> np.ndarray:
        """Returns 8-bit sRGB colours over a background of linear light: (C, H, W, 3) uint8."""
        if len(background) != 3:
            raise UsageError("a background has three channels")
        alpha = self.color[..., 3:]
        linear = np.clip(self.color[..., :3] * alpha + np.float32(background) * (1 - alpha), 0.0, 1.0)
        codes = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
        return np.round(codes * 255).astype(np.uint8)

    def _repr_png_(self) -> bytes:
        return self.png()

    def __repr__(self) -> str:
        count, height, width, _ = self.color.shape
        maps = f", maps {', '.join(self.maps)}" if self.maps else ""
        return f"<epsplat.Frames: {count} of {width} x {height}{maps}>"
