"""Pictures that several processes draw, by parts as bytes."""

import subprocess

import pytest
from conftest import DATA, same

import epsplat


@pytest.fixture(scope="module")
def renderer():
    return epsplat.Renderer(epsplat.read(DATA / "autzen.laz"), 160, 120, adapter="vulkan", aov=["depth", "normal"])


def drawn(renderer, of, view=None):
    depths = [renderer.part(number, of, view) for number in range(1, of + 1)]
    return depths, [renderer.part(number, of, view, within=depths) for number in range(1, of + 1)]


@pytest.mark.parametrize("of", [1, 2, 3, 7])
def test_parts_make_the_picture_of_one_process(renderer, of):
    view = epsplat.View(from_="iso")
    known = renderer.render(view)
    _, sums = drawn(renderer, of, view)
    # Some of them merged first, in another order.
    merged = epsplat.merge([epsplat.merge(sums[of // 2 :]), *reversed(sums[: of // 2])])
    for parts in (sums, merged):
        frames = epsplat.picture(parts, adapter="vulkan")
        assert same(frames.color, known.color) and same(frames.depth, known.depth) and same(frames.normal, known.normal)
    assert same(frames.viewmats, known.viewmats)


def test_parts_are_those_of_the_command(renderer, program, tmp_path):
    line = [program, "render", DATA / "autzen.laz", "--size", "160x120", "--adapter", "vulkan", "--aov", "depth,normal"]
    line += ["--part", "2/3", "-o", tmp_path / "depth-2.part"]
    subprocess.run([str(word) for word in line], check=True, capture_output=True)
    by_command = (tmp_path / "depth-2.part").read_bytes()
    depths = [renderer.part(number, 3) for number in (1, 3)]
    sums = [renderer.part(number, 3, within=[by_command, *depths]) for number in (1, 2, 3)]
    assert same(epsplat.picture(sums, adapter="vulkan").color, renderer.render().color)


def test_wrong_parts_are_one_exception(renderer):
    depths, sums = drawn(renderer, 2)
    other = renderer.part(1, 2, epsplat.View(from_="top"))
    for call in [
        lambda: epsplat.picture(depths),
        lambda: epsplat.picture(sums[:1]),
        lambda: epsplat.picture([sums[0], sums[0]]),
        lambda: epsplat.merge([]),
        lambda: epsplat.merge([depths[0], sums[1]]),
        lambda: epsplat.merge([depths[0], other]),
        lambda: epsplat.picture([sums[0], sums[1][:-3]]),
        lambda: epsplat.merge([b"no part"]),
        lambda: renderer.part(1, 2, within=depths[0]),
        lambda: renderer.part(3, 2),
        lambda: renderer.part(0, 2),
    ]:
        with pytest.raises(epsplat.Error) as error:
            call()
        assert "\n" not in str(error.value)
