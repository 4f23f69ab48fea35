"""A picture that several processes draw together, with the bits of one.

    python several_processes.py CLOUD [PROCESSES]

Parts are bytes, so Dask's ``client.map(draw, ...)`` or a remote function of Ray do the same.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache, partial
from multiprocessing import get_context

import epsplat


@lru_cache
def renderer(path):
    return epsplat.Renderer(epsplat.read(path), 400, 300, aov=["depth"])


def draw(path, of, within, number):
    return renderer(path).part(number, of, within=within)


if __name__ == "__main__":
    path, of = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 2
    with ProcessPoolExecutor(of, mp_context=get_context("spawn")) as pool:
        depths = epsplat.merge(list(pool.map(partial(draw, path, of, None), range(1, of + 1))))
        sums = list(pool.map(partial(draw, path, of, depths), range(1, of + 1)))
    frames = epsplat.picture(sums)
    alone = renderer(path).render()
    same = frames.color.tobytes() == alone.color.tobytes() and frames.depth.tobytes() == alone.depth.tobytes()
    print(f"{of} processes, {sum(map(len, sums))} bytes of sums, the bits of one process: {same}")
