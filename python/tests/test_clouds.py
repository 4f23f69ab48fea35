"""Functions of clouds and of research have the results of the commands."""

import json
import subprocess

import numpy as np
import pytest
from conftest import DATA, ROOT, same

import epsplat


def run(program, *arguments):
    done = subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_surfels_are_those_of_the_command(program, tmp_path):
    source = DATA / "autzen.laz"
    run(program, "surfels", source, "-o", tmp_path / "command.ply", "--size", "ellipse", "--outliers", 3)
    made = epsplat.surfels(source, size="ellipse", outliers=3)
    made.save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "command.ply").read_bytes()
    arrays = made.arrays()
    count = made.report["surfels"]
    assert arrays["positions"].shape == (count, 3) and arrays["half_axes"].shape == (count, 2, 3)


def test_the_arrays_of_a_file_make_the_same_scene():
    scene = epsplat.read(DATA / "autzen.laz")
    again = epsplat.Scene(**scene.arrays(), up="z")
    one, other = (epsplat.Renderer(of, 64, 48, aov=["depth"]).render() for of in (scene, again))
    assert same(one.depth, other.depth) and same(one.color, other.color)


def test_a_mesh_is_sampled_as_by_the_command(program, tmp_path):
    source = DATA / "bunny.obj"
    run(program, "sample", source, "-o", tmp_path / "command.ply", "--count", 3000, "--seed", 7)
    made = epsplat.sample(source, 3000, seed=7)
    made.save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "command.ply").read_bytes()
    assert made.report["samples"] == 3000
    # A mesh of arrays is the same mesh.
    mesh = epsplat.read(source).arrays()
    arrays = epsplat.Scene(mesh["positions"], triangles=mesh["triangles"])
    assert len(epsplat.sample(arrays, 500)) == 500
    with pytest.raises(epsplat.UsageError, match="priority"):
        epsplat.sample(source, 10, priority="none")


def test_surfels_are_simplified_as_by_the_command(program, tmp_path):
    source = tmp_path / "surfels.ply"
    epsplat.sample(DATA / "bunny.obj", 4000).save(source)
    run(program, "simplify", source, "-o", tmp_path / "command.ply", "--tolerance", "rel:0.002")
    made = epsplat.simplify(source, tolerance="rel:0.002")
    made.save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "command.ply").read_bytes()
    assert made.report["selected"] == len(made) < 4000


def test_levels_are_those_of_the_command(program, tmp_path):
    source = DATA / "autzen.laz"
    run(program, "lod", source, "-o", tmp_path / "command.ply")
    report = epsplat.lod(source, tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "command.ply").read_bytes()
    assert report["nodes"] > 0 and report["levels"] > 1
    before = (tmp_path / "python.ply").read_bytes()
    with pytest.raises(epsplat.UsageError, match="overwritten"):
        epsplat.lod(tmp_path / "python.ply", tmp_path / "." / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == before


def test_coverage_is_that_of_the_command(program, tmp_path):
    source = tmp_path / "surfels.ply"
    epsplat.sample(DATA / "bunny.obj", 4000).save(source)
    line = [source, "--mesh", DATA / "bunny.obj", "--views", 4, "--side", 64, "--json", tmp_path / "command.json"]
    run(program, "coverage", *line)
    report = epsplat.coverage(source, DATA / "bunny.obj", views=4, side=64)
    assert report.pop("notes") == []
    assert report == json.loads((tmp_path / "command.json").read_text())


def test_points_that_views_see_are_those_of_the_command(program, tmp_path):
    source, cameras = DATA / "bunny.obj", DATA / "cameras" / "transforms.json"
    run(program, "visible", source, "--cameras", cameras, "-o", tmp_path / "seen.ply", "--json", tmp_path / "seen.json")
    counts = epsplat.visible(source, epsplat.cameras(cameras))
    known = json.loads((tmp_path / "seen.json").read_text())
    assert len(counts) == known["points"] and (counts > 0).sum() == known["written"]
    assert counts.sum() == sum(view["points"] for view in known["views"])
    # Colours change nothing, and cameras that look elsewhere are a warning.
    assert same(epsplat.visible(epsplat.read(source, color_by="z"), epsplat.cameras(cameras)), counts)
    away = epsplat.look_at((1e4, 0, 0), (2e4, 0, 0), (0, 1, 0))
    with pytest.warns(UserWarning, match="no view sees"):
        assert not epsplat.visible(source, away).any()


def test_an_orthophoto_has_the_bits_of_the_command(program, tmp_path):
    run(program, "render", DATA / "autzen.laz", "-o", tmp_path / "map.npz", "--pixel-size", 10, "--aov", "height")
    photo = epsplat.Renderer(epsplat.read(DATA / "autzen.laz"), aov=["height"]).orthophoto(10)
    with np.load(tmp_path / "map.npz") as arrays:
        assert same(photo.height[0], arrays["height"]) and same(photo.color[0], arrays["color"])
    # Files keep the place.
    photo.save(tmp_path / "map.tif")
    run(program, "render", DATA / "autzen.laz", "-o", tmp_path / "command.tif", "--pixel-size", 10, "--aov", "height")
    assert (tmp_path / "map.tif").read_bytes() == (tmp_path / "command.tif").read_bytes()
    photo.save(tmp_path / "map.png")
    run(program, "render", DATA / "autzen.laz", "-o", tmp_path / "command.png", "--pixel-size", 10)
    assert (tmp_path / "map.pgw").read_bytes() == (tmp_path / "command.pgw").read_bytes()
    assert photo.viewmats.shape == (1, 4, 4) and len(photo.views) == 1


def test_pictures_are_compared_as_by_the_command(program, tmp_path):
    scene = epsplat.read(DATA / "autzen.laz")
    one = epsplat.Renderer(scene, 96, 64, aov=["depth"]).render()
    exact = epsplat.Renderer(scene, 96, 64, aov=["depth", "decision"], backend="reference").render()
    one.save(tmp_path / "one.exr")
    exact.save(tmp_path / "exact.exr")
    run(program, "compare", tmp_path / "one.exr", tmp_path / "exact.exr", "--json", tmp_path / "error.json")
    error = epsplat.compare(one, exact)
    assert error == json.loads((tmp_path / "error.json").read_text())
    worst = epsplat.error_map(one, exact)
    assert worst.shape == (1, 64, 96) and np.isclose(worst[..., :].max(), max(m["max_abs"] for m in error["maps"][:2]))
    assert epsplat.compare(one, one)["psnr_db"] is None
    with pytest.raises(epsplat.UsageError, match="depht"):
        epsplat.error_map(one, exact, "depht")
    one.maps["depth"] = one.depth.astype(np.float64)
    assert epsplat.compare(one, exact) == error


def test_a_kernel_of_text_has_the_bits_of_a_kernel_of_a_file(command, tmp_path):
    text = "fn kernel_weight(rho2: f32) -> f32 { return (1.0 - rho2) * (1.0 - rho2); }\n"
    path = tmp_path / "mine.wgsl"
    path.write_text(text)
    known, _ = command(DATA / "autzen.laz", "--size", "96x64", "--source", f"kernel_ellipse.wgsl={path}")
    scene = epsplat.read(DATA / "autzen.laz")
    own = epsplat.Renderer(scene, 96, 64, wgsl={"kernel_ellipse.wgsl": text}).render()
    by_file = epsplat.Renderer(scene, 96, 64, source={"kernel_ellipse.wgsl": path}).render()
    plain = epsplat.Renderer(scene, 96, 64).render()
    assert same(own.color[0], known["color"]) and same(by_file.color, own.color) and not same(own.color, plain.color)
    with pytest.raises(epsplat.Error, match="kernel_ellipse.wgsl"):
        epsplat.Renderer(scene, 96, 64, wgsl={"kernel_ellipse.wgsl": "fn kernel_weight("}).render()


def test_a_study_gives_rows():
    rows = epsplat.study(ROOT / "benches" / "accumulators.toml", quick=True, runs=1, strict=False)
    assert rows and all(row["config"] and row["scene"] and row["machine"]["cpu"] for row in rows)
    with pytest.raises(epsplat.UsageError, match="runs"):
        epsplat.study(ROOT / "benches" / "accumulators.toml", quick=True, runs=0)


def test_options_that_would_do_nothing_are_refused(program, tmp_path):
    source = DATA / "autzen.laz"
    for call in [
        lambda: epsplat.surfels(source, where="Z[:120]"),
        lambda: epsplat.surfels(epsplat.read(source, color_by="z")),
        lambda: epsplat.lod(source, tmp_path / "lod.ply", color_by="z"),
        lambda: epsplat.sample(DATA / "bunny.obj", -1),
        lambda: epsplat.coverage(DATA / "bunny.obj", DATA / "bunny.obj", views=-1),
        lambda: epsplat.cameras(DATA / "cameras" / "transforms.json", scale=0),
        lambda: epsplat.cameras(DATA / "cameras" / "transforms.json", size=(-1, 2)),
    ]:
        with pytest.raises(epsplat.UsageError):
            call()
    # Limits of the scene are used.
    run(program, "surfels", source, "-o", tmp_path / "command.ply", "--outliers", 3)
    epsplat.surfels(epsplat.read(source, outliers=3)).save(tmp_path / "python.ply")
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "command.ply").read_bytes()


def test_gaussians_have_linear_colours(tmp_path):
    names = [*"xyz", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
    names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    head = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    head += [f"property float {name}" for name in names]
    # f_dc of the sRGB code 0.5 + 0.2820948 f_dc = 188 / 255.
    code = 188 / 255
    dc = (code - 0.5) / 0.28209479177387814
    row = np.array([0, 0, 0, 0, 0, 0, dc, dc, dc, 2.0, -3, -3, -9, 1, 0, 0, 0], "<f4")
    path = tmp_path / "gaussian.ply"
    path.write_bytes(("\n".join([*head, "end_header"]) + "\n").encode() + row.tobytes())
    color = epsplat.read(path).arrays()["colors"]
    assert color.dtype == np.float32 and np.allclose(color[0, :3], 0.503, atol=1e-3)
