"""Options are those of the command line, and errors have its sentences."""

import pathlib

import numpy as np
import pytest
from conftest import DATA

import epsplat


def test_a_wrong_option_is_refused_with_the_sentence_of_the_command_line(sphere):
    scene = epsplat.Scene(sphere)
    for options, part in [
        ({"epsilo": 1}, "--epsilon"),
        ({"epsilon": "abs:-2"}, "--epsilon"),
        ({"color_by": "z"}, "an option of Scene"),
        ({"eye": (1, 2, 3)}, "an option of View"),
        ({"lod_fade": True}, "--lod"),
        ({"blend": "nearest", "kernel": "hat"}, "--blend nearest has no weights"),
        ({"adapter": "no such card"}, "no such card"),
    ]:
        with pytest.raises(epsplat.Error) as error:
            epsplat.Renderer(scene, **options)
        assert part in str(error.value), str(error.value)
        assert "\n" not in str(error.value)


def test_a_missing_file_is_an_os_error():
    with pytest.raises(FileNotFoundError, match="cannot read"):
        epsplat.read("no such file.ply")
    with pytest.raises(epsplat.FileError):
        epsplat.read(pathlib.Path("no such file.ply"))


def test_a_malformed_file_is_named(tmp_path):
    path = tmp_path / "broken.ply"
    path.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 1\n")
    with pytest.raises(epsplat.MalformedError, match="broken.ply"):
        epsplat.Renderer(epsplat.read(path), backend="reference")


def test_values_of_all_kinds_are_understood(sphere):
    scene = epsplat.Scene(sphere, outliers=None)
    renderer = epsplat.Renderer(
        scene,
        np.int64(32),
        24,
        backend="reference",
        near=np.float32(0.001),
        light=[(1, 1, 1), "headlight:0.3"],
        background=np.array([1.0, 0.5, 0.25]),
        aov="depth,normal",
        shading="lambert",
        legend=False,
    )
    frames = renderer.render()
    assert frames.color.shape == (1, 24, 32, 4) and sorted(frames.maps) == ["depth", "normal"]
    assert np.allclose(frames.color[0, 0, 0], [1.0, 0.5, 0.25, 1.0])
    assert frames.maps["normal"].shape == (1, 24, 32, 3)
    more = dict(legend=np.False_, light=list(np.float32([1, 1, 1])), aov=[], samples=np.array(1))
    plain = epsplat.Renderer(scene, 32, 24, backend="reference", **more).render()
    assert plain.maps == {}


def test_repr_says_what_it_is(sphere, reference):
    frames = reference.render()
    assert repr(frames) == "<epsplat.Frames: 1 of 64 x 48, maps depth>"
    assert "5000 points" in repr(epsplat.Scene(sphere)) and "autzen" in repr(epsplat.read(DATA / "autzen.laz"))
    assert repr(reference).startswith("<epsplat.Renderer of <epsplat.Scene")
    assert "--fov=30" in repr(epsplat.View(fov=30))
    assert frames._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(AttributeError, match="aov"):
        frames.normal


def test_a_kernel_is_replaced_by_a_string(sphere):
    scene = epsplat.Scene(sphere)
    text = "fn kernel_weight(rho: f32) -> f32 { return 1.0; }"
    with pytest.raises(epsplat.Error, match="no_such.wgsl"):
        epsplat.Renderer(scene, wgsl={"no_such.wgsl": text}).render()


def test_frames_are_saved(reference, tmp_path):
    frames = reference.render()
    frames.save(tmp_path / "a.png")
    frames.save(tmp_path / "a.npz")
    assert (tmp_path / "a.png").read_bytes() == frames.png()
    with np.load(tmp_path / "a.npz") as arrays:
        assert np.array_equal(arrays["depth"], frames.depth[0])
    with pytest.raises(epsplat.UsageError, match="must end in"):
        frames.save(tmp_path / "a.gif")
