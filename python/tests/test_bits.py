"""The same bits as the command line, for every map and mode."""

import subprocess

import numpy as np
import pytest
from conftest import DATA, same

import epsplat

SIZE = ["--size", "160x120"]

MODES = [
    ("plain", "autzen.laz", {}, {}, ["depth", "normal", "height", "weight", "count", "index"]),
    ("epsilon", "autzen.laz", {}, {"epsilon": "rel:0.02", "kernel": "hat"}, ["depth"]),
    ("colour by z", "autzen.laz", {"color_by": "z", "color_map": "turbo"}, {}, ["height"]),
    ("layers", "autzen.laz", {}, {"composite": "layers:4", "opacity": 0.5}, ["layers", "transmittance", "tail"]),
    ("sorted", "autzen.laz", {}, {"composite": "sorted", "opacity": 0.5}, ["surfaces", "transmittance"]),
    ("facing", "autzen.laz", {}, {"facing": "circle"}, ["depth"]),
    ("lit", "autzen.laz", {}, {"shading": "phong", "light": [(1, 1, 1), "headlight:0.3"]}, ["normal"]),
    ("samples", "autzen.laz", {}, {"samples": 4, "background": (1, 1, 1)}, ["depth"]),
    ("levels", "autzen.laz", {}, {"splats": 2000}, ["depth"]),
    ("raster", "autzen.laz", {}, {"backend": "raster"}, ["depth"]),
    ("reference", "autzen.laz", {}, {"backend": "reference"}, ["depth", "decision"]),
]


def words(options):
    """The options as arguments of the command line."""
    for name, value in options.items():
        name = "--" + name.replace("_", "-")
        for one in value if isinstance(value, list) else [value]:
            text = ",".join(map(str, one)) if isinstance(one, tuple) else str(one)
            yield f"{name}={text}"


@pytest.mark.parametrize("name, file, scene, render, maps", MODES, ids=[mode[0] for mode in MODES])
def test_every_mode_has_the_bits_of_the_command_line(command, name, file, scene, render, maps):
    known, report = command(DATA / file, *SIZE, *words(scene), *words(render), "--aov", ",".join(maps))
    frames = epsplat.Renderer(epsplat.read(DATA / file, **scene), 160, 120, aov=maps, **render).render()
    assert same(frames.color[0], known["color"])
    assert sorted(frames.maps) == sorted(maps)
    for map_name in maps:
        assert same(frames.maps[map_name][0].view(np.uint32), known[map_name].view(np.uint32)), map_name
    assert frames.reports[0]["backend"] == report["backend"]


def test_texture_coordinates_have_the_bits_of_the_command_line(command, program, tmp_path):
    surfels = tmp_path / "torus.ply"
    subprocess.run([program, "generate", "torus", "--count", "4000", "--texture", "-o", surfels], check=True)
    image = DATA / "cube.png"
    known, _ = command(surfels, *SIZE, "--aov", "texz", "--texture", image)
    frames = epsplat.Renderer(epsplat.read(surfels, texture=image), 160, 120, aov=["texz"]).render()
    texz = frames.maps["texz"][0]
    assert same(texz.view(np.uint32), known["texz"].view(np.uint32)) and np.isfinite(texz).any()
    # Each of the twelve maps is compared, here or by MODES.
    assert len({name for mode in MODES for name in mode[4]} | {"texz"}) == 12


def test_another_picture_has_other_bits(command):
    known, _ = command(DATA / "autzen.laz", *SIZE)
    frames = epsplat.Renderer(epsplat.read(DATA / "autzen.laz"), 160, 120, epsilon="rel:0.2").render()
    assert not same(frames.color[0], known["color"])


def test_arrays_have_the_bits_of_a_file(command, sphere, tmp_path):
    rows = "\n".join(" ".join(map(repr, map(float, row))) for row in sphere)
    path = tmp_path / "sphere.xyz"
    path.write_text(rows + "\n")
    known, _ = command(path, *SIZE, "--aov", "depth,normal")
    frames = epsplat.Renderer(epsplat.Scene(sphere), 160, 120, aov=["depth", "normal"]).render()
    for name in ["depth", "normal"]:
        assert same(frames.maps[name][0], known[name]), name
