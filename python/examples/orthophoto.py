"""An orthophoto of a laser scan, and the heights of its surface.

    python orthophoto.py SCAN PIXEL OUT.png

PIXEL is the edge of a pixel in the units of the scan.
"""

import sys

import numpy as np

import epsplat

scan, pixel, out = sys.argv[1:]

photo = epsplat.Renderer(epsplat.read(scan), aov=["height"]).orthophoto(float(pixel))
photo.save(out)

height = photo.height[0]
known = height[np.isfinite(height)]
xmin, xmax, ymin, ymax = photo.extent
print(f"{out}: x {xmin} to {xmax}, y {ymin} to {ymax}, heights {known.min():.2f} to {known.max():.2f}")
