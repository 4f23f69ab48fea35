"""Pictures around a model.

    python turntable.py MODEL COUNT FOLDER
"""

import pathlib
import sys

import epsplat

model, count, folder = sys.argv[1], int(sys.argv[2]), pathlib.Path(sys.argv[3])

renderer = epsplat.Renderer(epsplat.read(model), 320, 240, shading="lambert", background="white")
folder.mkdir(exist_ok=True)
for step, view in enumerate(renderer.turntable(count, elevation=20)):
    renderer.render(view).save(folder / f"{step:04}.png")
print(f"{folder}: {count} pictures")
