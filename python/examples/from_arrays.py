"""A cloud that numpy makes, its surfels, and the points that a camera sees."""

import numpy as np

import epsplat

draw = np.random.default_rng(1)
points = draw.normal(size=(20000, 3)).astype(np.float32)
points /= np.linalg.norm(points, axis=1, keepdims=True)
colors = (128 + 127 * points).astype(np.uint8)

scene = epsplat.Scene(points, colors=colors)
surfels = epsplat.surfels(scene)
print({name: array.shape for name, array in surfels.arrays().items()})

viewmat = np.eye(4)
viewmat[2, 3] = 4.0
K = [[600.0, 0, 320], [0, 600.0, 240], [0, 0, 1]]
frames = epsplat.Renderer(surfels, 640, 480, aov=["depth", "index"]).render(viewmat, K)
print(frames, "nearest depth", frames.depth.min())

view = epsplat.look_at((0, 0, -4), (0, 0, 0))
seen = epsplat.visible(scene, view, size=(640, 480))
print(f"{(seen > 0).sum()} of {len(points)} points are seen")
