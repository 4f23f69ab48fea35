"""Arrays in, arrays out."""

import array as buffers
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import same

import epsplat


def depth(*arrays, **options):
    scene = epsplat.Scene(*arrays, **options)
    return epsplat.Renderer(scene, 64, 48, backend="reference", aov=["depth"]).render().depth


def test_any_memory_gives_the_same_bits(sphere):
    narrow = sphere.astype(np.float32)
    known = depth(narrow)
    assert np.isfinite(known).any() and np.isinf(known).any()
    wide = np.zeros((5000, 7))
    wide[:, 1:6:2] = narrow
    read_only = narrow.copy()
    read_only.flags.writeable = False

    class Interface:
        __array_interface__ = narrow.__array_interface__

    class Tensor:
        def __dlpack__(self, **_):
            return narrow.__dlpack__()

        def __dlpack_device__(self):
            return narrow.__dlpack_device__()

    # Rows of 22 bytes, and numbers at odd addresses.
    packed = np.zeros(5000, [("xyz", "f4", 3), ("i", "f4"), ("ring", "u2"), ("t", "f4")])
    packed["xyz"] = narrow
    odd = np.zeros(5000, [("flag", "u1"), ("xyz", "f8", 3)])
    odd["xyz"] = narrow
    kinds = {
        "packed records": packed["xyz"],
        "odd addresses": odd["xyz"],
        "masked, but nowhere": np.ma.masked_array(narrow, mask=np.zeros_like(narrow, bool)),
        "f64": narrow.astype(np.float64),
        "other byte order": narrow.astype(">f4"),
        "columns first": np.asfortranarray(narrow),
        "every second column": wide[:, 1:6:2],
        "backward": narrow[::-1][::-1],
        "read-only": read_only,
        "list": narrow.tolist(),
        "interface": Interface(),
        "DLPack": Tensor(),
        "buffer": memoryview(buffers.array("f", narrow.ravel().tolist())).cast("B").cast("f", (5000, 3)),
    }
    for name, positions in kinds.items():
        assert same(depth(positions), known), name


def test_the_result_does_not_share_memory_with_later_renders(reference):
    first = reference.render()
    kept = first.depth.copy()
    second = reference.render(epsplat.View(from_="top"))
    assert not same(second.depth, kept) and same(first.depth, kept)
    first.depth[:] = 0.0


def test_attributes_of_points_reach_the_picture(sphere):
    z = sphere[:, 2]
    by_axis = epsplat.Scene(sphere, color_by="z")
    by_name = epsplat.Scene(sphere, attributes={"height": z}, color_by="height")
    other = epsplat.Scene(sphere, attributes={"height": sphere[:, 0]}, color_by="height")
    colors = [epsplat.Renderer(scene, 64, 48, backend="reference").render().color for scene in [by_axis, by_name, other]]
    assert same(colors[0], colors[1]) and not same(colors[0], colors[2])


def test_codes_are_srgb_and_floats_are_linear(sphere):
    def color(colors, **more):
        scene = epsplat.Scene(sphere, colors=colors, **more)
        frames = epsplat.Renderer(scene, 64, 48, backend="reference", shading="unlit").render()
        return frames.color[0, 24, 32]

    codes = np.full((5000, 3), 188, np.uint8)
    assert abs(color(codes)[0] - 0.503) < 1e-3
    assert abs(color(np.full((5000, 3), 0.25))[1] - 0.25) < 1e-6
    assert abs(color(np.full((5000, 4), 0.25, np.float32))[1] - 0.25) < 1e-6
    # Fields of packed records too.
    rows = np.zeros(5000, [("x", "u1"), ("rgb", "u1", 3), ("light", "f4", 3)])
    rows["rgb"], rows["light"] = 188, 0.25
    assert abs(color(rows["rgb"])[0] - 0.503) < 1e-3 and abs(color(rows["light"])[1] - 0.25) < 1e-6


def test_given_sizes_and_normals_are_used(sphere):
    small = depth(sphere, normals=sphere, radii=np.full(5000, 0.01))
    large = depth(sphere, normals=sphere, radii=np.full(5000, 0.1))
    assert np.isfinite(small).sum() < np.isfinite(large).sum()
    s = np.cross(sphere, [0.3, 0.5, 0.7])
    s *= 0.1 / np.linalg.norm(s, axis=1, keepdims=True)
    axes = np.stack([s, np.cross(sphere, s)], axis=1)
    assert np.isfinite(depth(sphere, half_axes=axes)).sum() == np.isfinite(large).sum()


def test_triangles_make_a_mesh():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    scene = epsplat.Scene(corners, triangles=[[0, 1, 2], [0, 2, 3]])
    frames = epsplat.Renderer(scene, 64, 48, aov=["depth"]).look_at((0.5, 0.5, 3), (0.5, 0.5, 0), up=(0, 1, 0))
    assert frames.reports[0]["triangles"] == 2
    assert abs(frames.depth[0, 24, 32] - 3) < 1e-5


N = 5
GOOD = np.arange(15.0).reshape(N, 3)
BAD = {
    "no numbers": dict(positions="points"),
    "objects": dict(positions=[[object()] * 3] * N),
    "ragged": dict(positions=[[1, 2, 3], [1, 2]]),
    "complex": dict(positions=GOOD * 1j),
    "two columns": dict(positions=GOOD[:, :2]),
    "one axis": dict(positions=GOOD.ravel()),
    "three axes": dict(positions=GOOD[None]),
    "empty": dict(positions=np.zeros((0, 3))),
    "no axis": dict(positions=np.float64(3)),
    "fewer normals": dict(positions=GOOD, normals=GOOD[:3]),
    "radii with two axes": dict(positions=GOOD, radii=GOOD),
    "half-axes of two": dict(positions=GOOD, half_axes=GOOD),
    "colours of five": dict(positions=GOOD, colors=np.zeros((N, 5))),
    "colours of text": dict(positions=GOOD, colors="red"),
    "colours of 16 bits": dict(positions=GOOD, colors=np.full((N, 3), 65535, np.uint16)),
    "colours of int64": dict(positions=GOOD, colors=[[255, 0, 0]] * N),
    "alpha of one": dict(positions=GOOD, alpha=[1.0]),
    "alpha of codes": dict(positions=GOOD, alpha=np.full(N, 255, np.uint8)),
    "masked": dict(positions=np.ma.masked_greater(GOOD, 7.0)),
    "a filter of files": dict(positions=GOOD, where="Z[:1]"),
    "classes of files": dict(positions=GOOD, classes="2"),
    "triangles of floats": dict(positions=GOOD, triangles=[[0.0, 1.0, 2.0]]),
    "triangles out of range": dict(positions=GOOD, triangles=[[0, 1, 5]]),
    "triangles below zero": dict(positions=GOOD, triangles=[[0, 1, -1]]),
    "attribute of another length": dict(positions=GOOD, attributes={"a": [1.0]}, color_by="a"),
    "no such attribute": dict(positions=GOOD, color_by="a"),
    "no such up": dict(positions=GOOD, up="x"),
}


@pytest.mark.parametrize("arguments", BAD.values(), ids=BAD.keys())
def test_bad_arrays_are_one_exception(arguments):
    with pytest.raises(epsplat.UsageError) as error:
        epsplat.Scene(**arguments)
    assert "\n" not in str(error.value)


def test_more_points_than_memory_are_refused():
    def claimed(dtype, rows):
        return np.broadcast_to(np.zeros((1, 3), dtype), (rows, 3))

    # Of other types a copy is needed at once.
    for dtype in [np.uint16, np.dtype(">f4")]:
        with pytest.raises(epsplat.NoMemoryError, match="MiB") as error:
            epsplat.Scene(claimed(dtype, 2**36))
        assert isinstance(error.value, MemoryError)
    for dtype in [np.float32, np.float64]:
        with pytest.raises(epsplat.UsageError, match="4294967295"):
            epsplat.Scene(claimed(dtype, 2**36))
        scene = epsplat.Scene(claimed(dtype, 2**32 - 1))
        with pytest.raises(epsplat.NoMemoryError, match="MiB"):
            epsplat.Renderer(scene, 64, 48, backend="reference")
    with pytest.raises(epsplat.NoMemoryError, match="triangles"):
        epsplat.Scene(GOOD, triangles=claimed(np.int64, 2**36))


def test_pictures_that_memory_cannot_hold_are_refused(reference):
    views = reference.turntable(1000, size=(8192, 8192))
    with pytest.raises(epsplat.NoMemoryError, match="1000 pictures of 8192x8192"):
        reference.render(views)
    assert np.isfinite(reference.render().depth).any()


def test_a_scene_shares_the_memory_of_its_arrays():
    """Neither float32 nor float64 is copied."""
    program = """
import epsplat, numpy as np
def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096
draw = np.random.default_rng(1)
normals = draw.normal(size=(1_000_000, 3)).astype(np.float32)
radii = np.full(1_000_000, 0.001, np.float32)
# The first scene loads code.
scenes = [epsplat.Scene(normals[:9])]
for positions in (normals, normals.astype(np.float64)):
    own = resident()
    scenes.append(epsplat.Scene(positions, normals=normals, radii=radii))
    print((resident() - own) / 1e6)
"""
    if not os.path.exists("/proc/self/statm"):
        pytest.skip("the system tells no resident memory by /proc")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    bytes_a_point = [float(line) for line in done.stdout.split()]
    # A copy of positions would have 12 bytes or more.
    assert len(bytes_a_point) == 2 and max(bytes_a_point) < 1, bytes_a_point


def test_points_that_are_not_finite_are_left_out_and_counted(sphere):
    holes = sphere.copy()
    holes[::7] = np.nan
    renderer = epsplat.Renderer(epsplat.Scene(holes), 64, 48, backend="reference")
    assert any("not finite" in note or "finite" in note for note in renderer.notes), renderer.notes
    with pytest.raises(epsplat.Error):
        epsplat.Renderer(epsplat.Scene(np.full((9, 3), np.nan)), backend="reference")
