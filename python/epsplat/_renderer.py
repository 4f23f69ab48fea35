"""Renderers."""

from __future__ import annotations

from typing import Any, Callable, List, Mapping, Optional, Sequence, Tuple, Union

from . import _arrays, _epsplat
from ._adapter import opening
from ._errors import UsageError
from ._frames import Frames
from ._progress import stages
from ._scene import Scene
from ._view import View, views

Progress = Optional[Callable[..., Any]]


class Renderer:
    """Renders views of a scene. Surfels, buffers and kernels are kept from call to call.

    The interpreter's lock is released meanwhile, so that other threads go on; several threads may
    share a renderer, which then serves one after another. Ctrl-C stops a render.

    Parameters
    ----------
    scene : Scene
    width, height : pixels, 1024 each by default
        For views that have no size of their own.
    wgsl : dict of str
        WGSL texts in place of built-in files, such as ``{"kernel_ellipse.wgsl": text}``.
    progress : ``tqdm.tqdm``, or a function ``progress(what, done, units)``
    options
        Options of ``epsplat render``: aov (maps beside the colour), epsilon, kernel, shading, light,
        background, composite, samples, backend ("gpu", "raster" or "reference"), adapter, near and
        others.

    Raises
    ------
    UsageError
        For options that do not exist, have a wrong value or do not go together.
    DeviceError
        If no adapter fits.
    """

    def __init__(
        self,
        scene: Scene,
        width: Optional[int] = None,
        height: Optional[int] = None,
        *,
        wgsl: Optional[Mapping[str, str]] = None,
        progress: Progress = None,
        **options: Any,
    ):
        if not isinstance(scene, Scene):
            raise TypeError("a renderer needs a Scene: make it with epsplat.read or epsplat.Scene")
        if (width is None) != (height is None):
            raise UsageError("a picture needs both width and height, or neither")
        if width is not None:
            options["size"] = (width, height)
        self._scene = scene
        wgsl = None if wgsl is None else dict(wgsl)
        with stages(progress) as shown, opening():
            self._renderer, self.notes = _epsplat.Renderer.of(scene._scene, options, wgsl, shown)

    def render(
        self,
        viewmats: Any = None,
        Ks: Any = None,
        *,
        convention: str = "opencv",
        progress: Progress = None,
    ) -> Frames:
        """Renders views.

        Parameters
        ----------
        viewmats : (C, 4, 4) world-to-camera matrices, a View, or a sequence of Views
            Without it, one view shows the whole scene.
        Ks : (C, 3, 3) or (3, 3) intrinsics, pixels; only with matrices
        convention : "opencv" or "opengl", the camera axes of the matrices

        Returns
        -------
        Frames
            Arrays of shape (C, H, W, ...).

        Raises
        ------
        UsageError
            For views of different sizes, or matrices that are no camera.
        KeyboardInterrupt
            After Ctrl-C; the renderer can be used again.
        """
        wanted = _views(viewmats, Ks, convention)
        with stages(progress) as shown, opening():
            return Frames(self._renderer.render(wanted, shown))

    def look_at(self, eye: Any, target: Any, up: Any = None, fov: Optional[float] = None, **options: Any) -> Frames:
        """Renders the view from ``eye`` to ``target``; see :func:`epsplat.look_at`."""
        return self.render(View(eye=eye, target=target, up=up, fov=fov, **options))

    def turntable(self, count: int, **options: Any) -> List[View]:
        """Returns ``count`` views on a circle around the scene, counter-clockwise from above.

        Options are from_, elevation, fov, size and others of :class:`View` that place no camera.
        """
        count = _arrays.whole("count", count, 1, 100_000)
        return [View._of(view) for view in self._renderer.turntable(count, options)]

    def orthophoto(
        self,
        pixel_size: float,
        bounds: Optional[Sequence[float]] = None,
        *,
        up: Any = None,
        progress: Progress = None,
    ) -> Frames:
        """Renders the map from straight above, north (+y) at the top.

        Parameters
        ----------
        pixel_size : the edge of a pixel, world units
        bounds : (xmin, ymin, xmax, ymax), world units; all data by default

        Returns
        -------
        Frames
            One picture; its ``extent`` is (xmin, xmax, ymin, ymax), as matplotlib takes it.
        """
        options = {"pixel_size": pixel_size, "bounds": bounds, "up": up}
        with stages(progress) as shown, opening():
            return Frames(self._renderer.map(options, shown))

    def part(
        self,
        number: int,
        of: int,
        view: Optional[View] = None,
        *,
        within: Union[bytes, Sequence[bytes], None] = None,
        progress: Progress = None,
    ) -> bytes:
        """Draws a part of a picture that several processes draw together.

        Each process has a renderer of the same scene, options and size, and draws another number. The
        first pass finds the nearest depths, the second one sums within those of all parts:

            depths = [renderer.part(number, 3) for number in (1, 2, 3)]
            sums = [renderer.part(number, 3, within=depths) for number in (1, 2, 3)]
            frames = epsplat.picture(sums)  # the bits of renderer.render()

        Parameters
        ----------
        number, of : part ``number`` of ``of``, counted from 1
        within : the depths of all parts, one by one or merged; without it, depths are drawn

        Returns
        -------
        bytes, as ``epsplat render --part`` writes them
        """
        number, of = _arrays.whole("number", number, 1, 2**32 - 1), _arrays.whole("of", of, 1, 2**32 - 1)
        parts = None if within is None else _parts(within)
        with stages(progress) as shown, opening():
            return self._renderer.part(None if view is None else view._view, (number, of), parts, shown)

    @property
    def bounds(self) -> Tuple[Tuple[float, ...], Tuple[float, ...]]:
        """The least and the greatest corner of the box of the scene's centres, world units."""
        least, greatest = self._renderer.bounds
        return tuple(least), tuple(greatest)

    def __repr__(self) -> str:
        return f"<epsplat.Renderer of {self._scene!r}>"


def _parts(parts: Union[bytes, Sequence[bytes]]) -> List[bytes]:
    """Returns parts as a list."""
    return [parts] if isinstance(parts, (bytes, bytearray)) else list(parts)


def merge(parts: Sequence[bytes]) -> bytes:
    """Joins parts of one picture, in any order and some of them first. Returns a part."""
    return _epsplat.merge_parts(_parts(parts))


def picture(parts: Union[bytes, Sequence[bytes]], *, progress: Progress = None, **options: Any) -> Frames:
    """Makes the picture of all parts that :meth:`Renderer.part` drew within the depths of all.

    Parameters
    ----------
    parts : sums of all parts, one by one or merged
    options : adapter
    """
    with stages(progress) as shown, opening():
        return Frames(_epsplat.picture(_parts(parts), options, shown))


def _views(viewmats: Any, Ks: Any, convention: str) -> List[_epsplat.View]:
    """Returns the views of the arguments of ``render``."""
    if viewmats is None:
        if Ks is not None:
            raise UsageError("intrinsics need matrices: give viewmats too")
        return []
    if isinstance(viewmats, View):
        viewmats = [viewmats]
    is_views = isinstance(viewmats, (list, tuple)) and any(isinstance(view, View) for view in viewmats)
    if is_views:
        if Ks is not None:
            raise UsageError("views have their own intrinsics: leave Ks out")
        if not all(isinstance(view, View) for view in viewmats):
            raise UsageError("views and matrices cannot be mixed: give one kind")
        return [view._view for view in viewmats]
    if Ks is None:
        raise UsageError("matrices need intrinsics: give Ks too")
    made: Union[List[View], Any] = views(viewmats, Ks, convention)
    if not made:
        raise UsageError("viewmats: the array is empty, and there is nothing to render")
    return [view._view for view in made]
