"""Cameras by matrices, by options and by files."""

import numpy as np
import pytest
from conftest import DATA, same

import epsplat

K = np.array([[70.0, 0, 32], [0, 70.0, 24], [0, 0, 1]])


def behind(distance):
    """A camera on the z axis that looks along it from below."""
    pose = np.eye(4)
    pose[2, 3] = distance
    return pose


def test_matrices_are_those_of_gsplat(reference):
    frames = reference.render(np.stack([behind(4.0), behind(5.0)]), np.stack([K, K]))
    assert frames.color.shape == (2, 48, 64, 4) and frames.depth.shape == (2, 48, 64)
    # The nearest point of the unit sphere lies at 3 and 4.
    assert np.allclose([frames.depth[0, 24, 32], frames.depth[1, 24, 32]], [3, 4], atol=0.01)
    assert np.allclose(frames.viewmats[1], behind(5.0)) and np.allclose(frames.Ks[0], K)
    # One view is the same alone, also with f32 matrices.
    assert same(reference.render(behind(5.0), K).depth[0], frames.depth[1])
    assert same(reference.render(behind(5.0).astype(np.float32), K.astype(np.float32)).depth[0], frames.depth[1])


def test_opengl_axes_are_those_of_the_other_convention(reference):
    flip = np.diag([1.0, -1, -1, 1])
    frames = reference.render(flip @ behind(4.0), K, convention="opengl")
    assert same(frames.depth, reference.render(behind(4.0), K).depth)
    assert not np.isfinite(reference.render(flip @ behind(4.0), K).depth).any()


def test_a_used_camera_gives_the_same_picture_again(reference):
    for view in [
        epsplat.View(from_="iso"),
        epsplat.View(from_="iso", ortho=3.0),
        epsplat.View(eye=(0, 0, -3), target=(0, 0, 0), up=(0, 1, 0), projection="fisheye", fov=120),
    ]:
        first = reference.render(view)
        assert same(reference.render(first.views).depth, first.depth)
    # Matrices of pinholes give the same picture up to rounding.
    first = reference.render(epsplat.View(from_="iso"))
    again = reference.render(first.viewmats, first.Ks).depth
    seen = np.isfinite(first.depth) & np.isfinite(again)
    assert np.isfinite(first.depth).sum() - seen.sum() <= 2 and np.abs(again[seen] - first.depth[seen]).max() < 1e-4


def test_look_at_is_that_of_open3d(reference):
    one = reference.look_at((0, 0, -4), (0, 0, 0), up=(0, 1, 0), fov=40)
    other = reference.render(epsplat.look_at(np.array([0, 0, -4]), [0, 0, 0], (0, 1, 0), fov=40.0))
    assert same(one.depth, other.depth) and abs(one.depth[0, 24, 32] - 3) < 0.01


def test_wrong_cameras_are_refused(reference):
    skew = K + np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
    mirror = np.diag([-1.0, 1, 1, 1])
    for arguments in [
        (behind(4.0),),
        (None, K),
        (behind(4.0)[:3], K),
        (behind(4.0), skew),
        (behind(4.0), np.stack([K, K])),
        (behind(4.0) * 2, K),
        (mirror, K),
        (behind(np.nan), K),
        (behind(4.0), K * np.nan),
        (behind(4.0), np.zeros((3, 3))),
        (np.zeros((0, 4, 4)), np.zeros((0, 3, 3))),
        ([epsplat.View(size=(9, 9)), epsplat.View(size=(8, 9))],),
        ([epsplat.View(), behind(4.0)],),
    ]:
        with pytest.raises(epsplat.UsageError) as error:
            reference.render(*arguments)
        assert "\n" not in str(error.value)
    with pytest.raises(epsplat.UsageError, match="convention"):
        reference.render(behind(4.0), K, convention="directx")
    assert np.isfinite(reference.render(behind(4.0), K).depth).any()


def test_a_folder_of_colmap_gives_its_photographs(reference, tmp_path):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 64 48 70 70 32 24\n2 OPENCV 64 48 70 70 32 24 0.1 0 0 0\n")
    # Quaternion (w, x, y, z), translation, camera, name; then a line of points.
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 4 1 one.jpg\n\n2 1 0 0 0 0 0 5 2 two.jpg\n\n")
    (tmp_path / "points3D.txt").write_text("")
    views = epsplat.cameras(tmp_path)
    assert [view.name for view in views] == ["one", "two"]
    frames = reference.render(views)
    assert same(frames.depth[0], reference.render(behind(4.0), K).depth[0])
    pinholes = reference.render(epsplat.cameras(tmp_path, ignore_distortion=True))
    assert same(pinholes.depth[1], reference.render(behind(5.0), K).depth[0])
    assert not same(frames.depth[1], pinholes.depth[1])
    half = reference.render(epsplat.cameras(tmp_path, scale=0.5))
    assert half.depth.shape == (2, 24, 32)


def test_a_camera_file_without_a_size_takes_that_of_the_renderer(reference, tmp_path):
    path = tmp_path / "camera.json"
    path.write_text('{"eye": [0, 0, -4], "target": [0, 0, 0], "up": [0, 1, 0]}')
    assert reference.render(epsplat.View(camera=path)).depth.shape == (1, 48, 64)
    assert reference.render(epsplat.View(camera=path, size=(32, 24))).depth.shape == (1, 24, 32)


def test_a_turntable_goes_around(reference):
    views = reference.turntable(4, size=(32, 24))
    frames = reference.render(views)
    assert frames.color.shape == (4, 24, 32, 4)
    eyes = [-pose[:3, :3].T @ pose[:3, 3] for pose in frames.viewmats]
    assert np.allclose(eyes[0][:2], -eyes[2][:2], atol=0.05) or np.allclose(eyes[0][::2], -eyes[2][::2], atol=0.05)


def test_an_orthophoto_lies_on_the_grid():
    renderer = epsplat.Renderer(epsplat.read(DATA / "autzen.laz"), aov=["height"])
    photo = renderer.orthophoto(20.0)
    (least, greatest) = renderer.bounds
    xmin, xmax, ymin, ymax = photo.extent
    assert xmin % 20 == 0 and xmin <= least[0] < xmin + 20 and ymin <= least[1] and greatest[0] <= xmax + 20
    assert photo.height.shape == photo.color.shape[:3]
    assert least[2] - 20 < np.median(photo.height[np.isfinite(photo.height)]) < greatest[2] + 20
