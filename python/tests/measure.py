"""Measures what the package costs over the library: python tests/measure.py [POINTS]

Prints the time of a call beside that of its frame, the memory of a scene, and the cost of handing
a batch on by DLPack. Figures of the guide are from this script.
"""

import statistics
import sys
import time

import numpy as np

import epsplat


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


def timed(call):
    start = time.perf_counter()
    result = call()
    return result, 1e3 * (time.perf_counter() - start)


count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
draw = np.random.default_rng(1)
points = draw.normal(size=(count, 3)).astype(np.float32)
points /= np.linalg.norm(points, axis=1, keepdims=True)
radii = np.full(count, 1.5 * np.sqrt(4 * np.pi / count), np.float32)

before = resident()
scene, scene_ms = timed(lambda: epsplat.Scene(points, normals=points, radii=radii))
after = resident()
print(f"{count} points of float32: scene in {scene_ms:.1f} ms, {(after - before) / count:.1f} bytes a point")
renderer, renderer_ms = timed(lambda: epsplat.Renderer(scene, 1024, 1024, aov=["depth"]))
print(f"renderer in {renderer_ms:.1f} ms, {(resident() - after) / count:.1f} bytes a point more")

over, calls, frames_ms = [], [], []
renderer.render()
for _ in range(15):
    frames, call_ms = timed(renderer.render)
    frame_ms = frames.reports[0]["total_ms"]
    calls.append(call_ms)
    frames_ms.append(frame_ms)
    over.append(call_ms / frame_ms - 1)
print(
    f"depth map 1024 x 1024: call {statistics.median(calls):.2f} ms, frame {statistics.median(frames_ms):.2f} ms, "
    f"over it {100 * statistics.median(over):.2f} % (median of 15)"
)

small = epsplat.Renderer(scene, 512, 512, aov=["depth"])
batch = small.render(small.turntable(8))
color = batch.color
_, shared_ms = timed(lambda: np.from_dlpack(color))
_, copied_ms = timed(color.copy)
print(f"a batch of {color.shape}: by DLPack {shared_ms:.4f} ms, a copy {copied_ms:.2f} ms, {color.nbytes >> 20} MiB")
assert np.shares_memory(np.from_dlpack(color), color)
