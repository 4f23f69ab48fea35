"""Fixtures of all tests: models of the repository, and its program."""

import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

import epsplat

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT / "data"


@pytest.fixture(scope="session")
def program():
    """The program of the command line, which renders the same pictures."""
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = target / "release" / "epsplat"
    if not path.exists():
        pytest.fail(f"{path} is missing: cargo build --release --all-features --bins")
    return path


@pytest.fixture
def command(program, tmp_path):
    """Renders by the command line, and returns the arrays of its .npz and its report."""

    def render(*arguments):
        out, report = tmp_path / "command.npz", tmp_path / "command.json"
        line = [program, "render", *arguments, "-o", out, "--json", report]
        done = subprocess.run([str(word) for word in line], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with np.load(out) as arrays:
            return {name: arrays[name] for name in arrays}, json.loads(report.read_text())

    return render


@pytest.fixture
def sphere():
    """5000 points on a sphere, in a known order."""
    index = np.arange(5000) + 0.5
    z = 1 - 2 * index / 5000
    angle = index * np.pi * (3 - 5**0.5)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def same(one, other):
    """Whether arrays have the same shape and bits."""
    one, other = np.ascontiguousarray(one), np.ascontiguousarray(other)
    return one.shape == other.shape and one.tobytes() == other.tobytes()


@pytest.fixture
def reference(sphere):
    """A small renderer of the f64 reference, for tests of anything but the device."""
    return epsplat.Renderer(epsplat.Scene(sphere), 64, 48, backend="reference", aov=["depth"])
