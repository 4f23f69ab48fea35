"""The compiled part. Use the package's own classes and functions, which call it."""

from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

__version__: str

class Scene:
    """Files, or points in memory."""

    @staticmethod
    def open(paths: Sequence[str], keywords: Dict[str, Any]) -> "Scene": ...
    @staticmethod
    def of_arrays(arrays: Dict[str, Any], keywords: Dict[str, Any]) -> "Scene": ...
    @property
    def files(self) -> List[Any]: ...
    @property
    def points(self) -> Optional[int]: ...

class View:
    """A camera, complete except for values from the scene and the renderer."""

    @property
    def name(self) -> str: ...
    @staticmethod
    def of_options(keywords: Dict[str, Any]) -> "View": ...
    @staticmethod
    def of_matrices(poses: np.ndarray, intrinsics: np.ndarray) -> List["View"]: ...
    @staticmethod
    def of_file(path: str, size: Tuple[int, int], scale: Optional[float], pinholes: bool) -> List["View"]: ...

class OfMap:
    """The place of a map on the earth."""

class Renderer:
    """The library's renderer."""

    @staticmethod
    def of(
        scene: Scene,
        keywords: Dict[str, Any],
        wgsl: Optional[Dict[str, str]],
        progress: Any,
    ) -> Tuple["Renderer", List[str]]: ...
    def render(self, views: Sequence[View], progress: Any) -> Dict[str, Any]: ...
    def turntable(self, count: int, keywords: Dict[str, Any]) -> List[View]: ...
    def part(
        self, view: Optional[View], share: Tuple[int, int], within: Optional[Sequence[bytes]], progress: Any
    ) -> bytes: ...
    def map(self, keywords: Dict[str, Any], progress: Any) -> Dict[str, Any]: ...
    @property
    def bounds(self) -> Tuple[Sequence[float], Sequence[float]]: ...

def merge_parts(parts: Sequence[bytes]) -> bytes: ...
def picture(parts: Sequence[bytes], keywords: Dict[str, Any], progress: Any) -> Dict[str, Any]: ...
def encode(color: np.ndarray, format: str) -> bytes: ...
def save(
    path: str,
    color: np.ndarray,
    maps: Mapping[str, np.ndarray],
    depth_scale: Optional[float] = None,
    place: Optional[OfMap] = None,
) -> None: ...
def surfels(
    scene: Scene, size: str, orient: Sequence[str], estimate_normals: bool, keywords: Dict[str, Any], progress: Any
) -> Tuple[Scene, str, List[str]]: ...
def sample(
    scene: Scene,
    count: int,
    priority: str,
    method: str,
    shape: str,
    depth: Optional[int],
    seed: int,
    progress: Any,
) -> Tuple[Scene, str, List[str]]: ...
def simplify(
    scene: Scene, tolerance: str, shape: str, relax: int, progress: Any
) -> Tuple[Scene, str, List[str]]: ...
def lod(
    scene: Scene, output: str, cut: Optional[float], keywords: Dict[str, Any], progress: Any
) -> Tuple[str, List[str]]: ...
def coverage(scene: Scene, of: Scene, views: int, side: int, progress: Any) -> Tuple[str, List[str]]: ...
def visible(
    scene: Scene, views: Sequence[View], keywords: Dict[str, Any], progress: Any
) -> Tuple[List[np.ndarray], List[int], List[str]]: ...
def arrays(scene: Scene) -> List[Dict[str, np.ndarray]]: ...
def write(scene: Scene, output: str, progress: Any) -> None: ...
def compare(
    color: np.ndarray,
    maps: Mapping[str, np.ndarray],
    exact: np.ndarray,
    exact_maps: Mapping[str, np.ndarray],
) -> str: ...
def study(
    path: str,
    quick: bool,
    runs: Optional[int],
    adapter: Optional[str],
    out: Optional[str],
    progress: Any,
) -> Tuple[str, str, List[str], List[str]]: ...
