"""Progress, signals and threads."""

import functools
import io
import os
import random
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import DATA, same

import epsplat


def test_progress_reaches_a_function_and_a_class(sphere):
    told, bars = [], []

    class Bar:
        def __init__(self, total, desc):
            self.total, self.desc, self.done, self.closed = total, desc, 0, False
            bars.append(self)

        def update(self, units):
            self.done += units

        def close(self):
            self.closed = True

    scene = epsplat.read(DATA / "autzen.laz")
    renderer = epsplat.Renderer(scene, 64, 48, backend="reference", progress=lambda *now: told.append(now))
    renderer.render(progress=Bar)
    assert told and all(isinstance(what, str) and (units == 0 or done <= units) for what, done, units in told)
    assert bars and all(bar.closed for bar in bars) and any(bar.done == bar.total for bar in bars)
    count = len(bars)
    renderer.render(progress=functools.partial(Bar))
    assert len(bars) > count and all(bar.closed for bar in bars)

    class Stopping(Bar):
        def update(self, units):
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        renderer.render(progress=Stopping)
    assert all(bar.closed for bar in bars)


def test_progress_reaches_tqdm(sphere):
    from tqdm import tqdm

    out = io.StringIO()
    bars = functools.partial(tqdm, file=out, mininterval=0)
    renderer = epsplat.Renderer(epsplat.Scene(sphere), 64, 48, backend="reference", progress=bars)
    renderer.render(progress=bars)
    shown = out.getvalue()
    for what in ["finding neighbours", "rendering rows"]:
        assert what in shown
    # Each pixel has four samples, in two rows.
    assert "96/96" in shown and "5000/5000" in shown


def test_an_exception_of_a_callback_stops_the_call(reference):
    def fail(*_):
        raise RuntimeError("enough")

    known = reference.render().depth
    with pytest.raises(RuntimeError, match="enough"):
        reference.render(progress=fail)
    assert same(reference.render().depth, known)


def interrupted(renderer, after):
    """Renders, and sends Ctrl-C after a time. Returns whether the render was stopped."""
    timer = threading.Timer(after, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        renderer.render(epsplat.View(size=(256, 192)))
        timer.join()
        # The signal came after the render.
        time.sleep(0.001)
    except KeyboardInterrupt:
        timer.join()
        return True
    return False


@pytest.mark.parametrize("backend", ["gpu", "reference"])
def test_interrupts_leave_a_usable_renderer(backend):
    scene = epsplat.read(DATA / "autzen.laz")
    renderer = epsplat.Renderer(scene, 64, 48, backend=backend, aov=["depth"])
    known = renderer.render().depth
    draw = random.Random(1)
    times = int(os.environ.get("EPSPLAT_INTERRUPTS", 10))
    stopped = 0
    for _ in range(times):
        try:
            stopped += interrupted(renderer, draw.uniform(0.0, 0.1))
        except KeyboardInterrupt:
            # The signal came between the render and the end of the function.
            pass
    assert stopped > 0
    assert same(renderer.render().depth, known)


def test_threads_render_at_once(sphere):
    scene = epsplat.Scene(sphere)
    shared = epsplat.Renderer(scene, 64, 48, aov=["depth"])
    known = shared.render().depth
    waits, results = [], []

    def work():
        own = epsplat.Renderer(scene, 64, 48, aov=["depth"])
        for _ in range(5):
            results.append(same(own.render().depth, known) and same(shared.render().depth, known))

    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    # The interpreter goes on meanwhile.
    while any(thread.is_alive() for thread in threads):
        before = time.perf_counter()
        time.sleep(0.001)
        waits.append(time.perf_counter() - before)
    assert results == [True] * 20
    # Held during renders, the lock would be free only between them.
    assert sum(wait < 0.05 for wait in waits) > 20, waits


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_forked_process_says_that_it_cannot_render(sphere, reference):
    known = reference.render().depth
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            reference.render()
            text = "a picture"
        except BaseException as error:  # noqa: BLE001
            text = f"{type(error).__name__}: {error}"
        os.write(write, text.encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as told:
        text = told.read()
    os.waitpid(child, 0)
    assert text.startswith("DeviceError") and "spawn" in text
    assert same(reference.render().depth, known)


def test_renders_in_a_loop_leak_nothing():
    count = int(os.environ.get("EPSPLAT_RENDERS", 60))
    program = f"""
import epsplat, numpy as np, threading
def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096
draw = np.random.default_rng(1)
scene = epsplat.Scene(draw.normal(size=(500, 3)))
renderer = epsplat.Renderer(scene, 128, 128, aov=["depth", "normal"])
def many(times):
    for _ in range(times):
        renderer.render()
many({count} // 2)
first = resident()
many({count})
threads = [threading.Thread(target=many, args=({count} // 4,)) for _ in range(4)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
print(first, resident())
"""
    if not os.path.exists("/proc/self/statm"):
        pytest.skip("the system tells no resident memory by /proc")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    first, last = map(int, done.stdout.split())
    # The arrays of a render have 0.5 MB, so those of all have 63 MB or more.
    assert last - first < max(0.01 * first, 8e6), (first, last)


def test_the_import_is_quick():
    line = "import time, numpy; start = time.perf_counter(); import epsplat; print(time.perf_counter() - start)"
    times = [float(subprocess.run([sys.executable, "-c", line], capture_output=True, text=True).stdout) for _ in range(3)]
    assert min(times) < 0.15, times


def test_nothing_is_printed():
    """Drivers look for a display in a folder that servers do not have."""
    program = """
import epsplat, numpy as np, os
for _ in range(2):
    epsplat.Renderer(epsplat.Scene(np.eye(3)), 32, 24).render()
assert "XDG_RUNTIME_DIR" not in os.environ
"""
    environment = {name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_no_driver_is_no_obstacle(sphere, tmp_path):
    """Without any driver the f64 reference renders."""
    np.save(tmp_path / "points.npy", sphere)
    program = f"""
import epsplat, numpy as np
frames = epsplat.Renderer(epsplat.Scene(np.load({str(tmp_path / "points.npy")!r})), 32, 24).render()
assert frames.reports[0]["backend"] == "reference", frames.reports
assert any("reference" in note for note in epsplat.Renderer(epsplat.Scene(np.eye(3))).notes)
"""
    # The loader finds no drivers there, and no other interface is asked.
    environment = {**os.environ, "VK_DRIVER_FILES": "/nowhere", "VK_ICD_FILENAMES": "/nowhere", "WGPU_BACKEND": "vulkan"}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)
