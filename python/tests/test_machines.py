"""Pictures that several processes draw, by parts as bytes."""

import concurrent.futures
import subprocess

import pytest
from conftest import DATA, ROOT, same

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


class Client:
    """A client of Dask, as far as the lines of the guide use it."""

    def __init__(self, pool):
        self.pool = pool

    def map(self, function, values, **others):
        return [self.pool.submit(function, value, **others) for value in values]

    def gather(self, futures):
        return [future.result() for future in futures]


def test_the_lines_of_the_guide_draw(tmp_path, monkeypatch):
    guide = (ROOT / "src/guide/machines.md").read_text()
    lines = guide.split("```python\n")[1].split("```")[0].replace("1920, 1080", "160, 120")
    assert "client.map" in lines and "160, 120" in lines
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scan.laz").write_bytes((DATA / "autzen.laz").read_bytes())
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        exec(lines, {"epsplat": epsplat, "client": Client(pool)})
    assert (tmp_path / "scan.png").stat().st_size > 1000
