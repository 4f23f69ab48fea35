"""Makes scenes of random arrays, good and bad: python tests/fuzz.py SECONDS [SEED]

Each has to become a picture or one exception of the package.
"""

import collections
import sys
import time

import numpy as np

import epsplat

DTYPES = ["f4", "f8", ">f4", ">f8", "f2", "i4", "i8", "u1", "u2", "?", "c8", "S3", "U2", "O", "M8[s]", "g"]
NAMES = {"normals": (3,), "radii": (), "half_axes": (2, 3), "colors": (4,), "alpha": (), "texture": (2,), "triangles": (3,)}
ODD = [np.nan, np.inf, -np.inf, 0.0, 1e300, -1e38, 1e-300, 2**31, -1]


def array(draw, rows, tail):
    """An array that mostly has the shape, in memory of any kind, with odd values."""
    shape = [rows, *tail]
    if draw.random() < 0.1:
        shape[draw.integers(len(shape))] += int(draw.integers(-1, 3))
    if draw.random() < 0.05:
        shape = [1, *shape] if draw.random() < 0.5 else shape[1:]
    shape = [max(side, 0) for side in shape]
    values = draw.normal(size=shape) * 10 ** draw.uniform(-3, 6)
    for _ in range(draw.integers(0, 4)):
        if values.size:
            values.flat[draw.integers(values.size)] = draw.choice(ODD)
    dtype = draw.choice(DTYPES) if draw.random() < 0.3 else draw.choice(DTYPES[:2])
    with np.errstate(all="ignore"):
        try:
            values = np.asarray(values.astype(dtype))
        except (TypeError, ValueError, OverflowError):
            return values
    kind = draw.integers(8)
    if kind == 7 and values.dtype.kind in "iuf" and values.ndim:
        record = np.zeros(len(values), [("flag", "u1"), ("values", values.dtype, values.shape[1:])])
        record["values"] = values
        return record["values"]
    if kind == 0 and values.ndim:
        return values[::-1]
    if kind == 1:
        return np.asfortranarray(values)
    if kind == 2 and values.flags.owndata:
        values.flags.writeable = False
    if kind == 3:
        return values.tolist()
    if kind == 4 and values.ndim and values.shape[0]:
        return np.broadcast_to(values[:1], values.shape)
    if kind == 5 and values.ndim and values.shape[0] and draw.random() < 0.02:
        return np.broadcast_to(values[:1], (2**31, *values.shape[1:]))
    return values


def attempt(draw):
    rows = int(draw.choice([0, 1, 2, 3, 4, 7, 50, 300]))
    given = {"positions": array(draw, rows, (3,))}
    for name, tail in NAMES.items():
        if draw.random() < 0.25:
            given[name] = array(draw, rows, tail)
    if draw.random() < 0.2:
        given.update(attributes={"a": array(draw, rows, ())}, color_by="a")
    scene = epsplat.Scene(**given)
    frames = epsplat.Renderer(scene, 24, 16, backend="reference", aov=["depth", "normal"]).render()
    assert frames.color.shape == (1, 16, 24, 4) and not np.isnan(frames.depth).any()


def main(seconds, seed):
    draw, outcomes, end = np.random.default_rng(seed), collections.Counter(), time.time() + seconds
    while time.time() < end:
        try:
            attempt(draw)
            outcomes["a picture"] += 1
        except epsplat.Error as error:
            assert "\n" not in str(error) and "unexpectedly" not in str(error), error
            outcomes[type(error).__name__] += 1
    print(dict(outcomes))


main(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)
