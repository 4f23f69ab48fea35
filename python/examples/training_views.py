"""Depth and normals of a scene at the cameras of its photographs, for training.

    python training_views.py CLOUD CAMERAS OUT.npz

CAMERAS is COLMAP's folder, a transforms.json or a cameras.json.
"""

import sys

import numpy as np

import epsplat

cloud, cameras, out = sys.argv[1:]

views = epsplat.cameras(cameras)
renderer = epsplat.Renderer(epsplat.read(cloud), aov=["depth", "normal"])
frames = renderer.render(views)

names = [view.name for view in views]
np.savez(out, names=names, depth=frames.depth, normal=frames.normal, viewmats=frames.viewmats, Ks=frames.Ks)
print(f"{out}: {len(frames)} views of {frames.depth.shape[2]} x {frames.depth.shape[1]}")
