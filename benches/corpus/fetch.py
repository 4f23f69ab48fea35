"""Fetches source packages from PyPI and Debian, and unpacks the files that epsplat can read."""

import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile

import numpy as np

SUFFIXES = (".ply", ".las", ".laz", ".obj", ".e57", ".pcd")
# A version is given where later source packages leave the test files out.
PYPI = ["laspy", "pdal==2.4.2", "pdal==3.0.2", "py3dtiles", "pypcd4", "DracoPy", "openmesh", "meshio", "trimesh",
        "plyfile", "pye57"]
# A suite is given where its version has more test files than the others.
DEBIAN = [
    "pcl", "assimp/sid", "assimp", "draco", "trimesh", "tinyobjloader", "open3d", "cgal", "pdal", "cloudcompare",
    "meshlab", "f3d", "vtk9", "libe57format", "python-laspy", "python-meshio", "qgis", "prusa-slicer",
]
# The names of a Debian source package's upstream archives.
SOURCES = re.compile(r"\.orig.*\.tar\.\w+$")
# Tried in this order, because a mirror may lack some files.
SUITES = ["trixie", "bookworm", "sid", "bullseye"]


def fetch(arguments):
    """Gets and unpacks packages; prints and skips those that are not available."""
    folder = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    missing = []
    for wanted in arguments.pypi:
        print(f"PyPI: {wanted}", flush=True)
        name = wanted.partition("==")[0]
        with tempfile.TemporaryDirectory() as kept:
            # Not `--no-binary :all:`, which would also build the package's build tools from source.
            command = [sys.executable, "-m", "pip", "download", "--no-deps", "--no-binary", name, "--dest", kept]
            problem = run_quietly([*command, wanted])
            archives = sorted(pathlib.Path(kept).iterdir())
            if not archives:
                missing.append(f"{wanted} (PyPI): {problem or 'no source package'}")
            for archive in archives:
                unpack(archive, folder / "pypi" / name)
    if arguments.debian:
        missing += fetch_debian(folder / "debian", arguments.debian, arguments.suites)
    if arguments.e57:
        write_e57(folder)
    for line in missing:
        print(f"not to be had: {line}")
    return 0


def fetch_debian(folder, wanted, suites):
    """Runs `apt-get source` with separate lists: it needs no root and leaves the machine's."""
    missing = []
    with tempfile.TemporaryDirectory() as state:
        apt, problem = apt_for_sources(pathlib.Path(state), suites)
        if problem:
            return [f"{name} (Debian): {problem}" for name in wanted]
        # If the mirror lacks one suite, the others are still used.
        run_quietly(apt + ["update"])
        for name, _, first in (name.partition("/") for name in wanted):
            print(f"Debian: {name}", flush=True)
            problems, archives = [], []
            places = [f"{name}/{suite}" for suite in dict.fromkeys([first, *suites]) if suite]
            for place in [*places, name]:
                with tempfile.TemporaryDirectory() as kept:
                    problem = run_quietly(apt + ["source", "--download-only", place], cwd=kept)
                    problems.append(f"{place}: {problem}")
                    # apt has checked the archive's hash, so it is used even if its description is
                    # missing.
                    archives = [path for path in pathlib.Path(kept).iterdir() if SOURCES.search(path.name)]
                    for archive in archives:
                        unpack(archive, folder / name)
                if archives:
                    break
            if not archives:
                missing.append(f"{name} (Debian): {'; '.join(problems)}")
    return missing


def apt_for_sources(state, suites):
    """Returns an apt-get command that reads source packages, and an error or None.

    It uses the machine's own package sources, and more suites of the first of them.
    """
    parts = pathlib.Path("/etc/apt")
    files = [parts / "sources.list", *sorted((parts / "sources.list.d").glob("*"))]
    lines, stanzas = [], []
    for file in files:
        text = file.read_text(errors="replace") if file.is_file() else ""
        if file.suffix == ".sources":
            stanzas += [stanza for stanza in re.split(r"\n\s*\n", text) if re.search(r"^Types:.*\bdeb\b", stanza, re.M)]
        elif file.suffix == ".list":
            lines += re.findall(r"^\s*deb\s.*$", text, re.M)
    stanzas += [re.sub(r"^Suites:.*$", f"Suites: {' '.join(suites)}", s, flags=re.M) for s in stanzas[:1] if suites]
    if not stanzas and lines:
        first = re.match(r"(\s*deb\s+(?:\[.*?\]\s+)?\S+\s+)\S+(.*)", lines[0])
        lines += [f"{first[1]}{suite}{first[2]}" for suite in suites if first]
    if not stanzas and not lines:
        return [], "apt has no sources here"
    own = state / "own"
    for part in ("lists/partial", "cache/archives/partial", "own"):
        (state / part).mkdir(parents=True)
    types = [re.sub(r"^Types:.*$", "Types: deb-src", stanza, flags=re.M) for stanza in stanzas]
    (own / "all.sources").write_text("\n\n".join(types) + "\n")
    (own / "all.list").write_text("".join(re.sub(r"^\s*deb\s", "deb-src ", line) + "\n" for line in lines))
    options = {
        "Dir::Etc::sourcelist": "/dev/null",
        "Dir::Etc::sourceparts": own,
        "Dir::State::lists": state / "lists",
        "Dir::Cache": state / "cache",
        # apt's sandbox user may not be able to read these folders.
        "APT::Sandbox::User": "",
    }
    words = [word for key, value in options.items() for word in ("-o", f"{key}={value}")]
    return ["apt-get", "--quiet=2", *words], None


def run_quietly(command, **more):
    """Runs a command; returns the last line of its stderr if it failed, else None."""
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=1200, **more)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    complaints = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return complaints[-1] if done.returncode != 0 else None


def unpack(archive, folder):
    """Unpacks the files that epsplat can read, also from zip archives within."""
    folder.mkdir(parents=True, exist_ok=True)
    if zipfile.is_zipfile(archive):
        unpack_zip(archive, folder)
        return
    with tarfile.open(archive) as members:
        for member in members:
            name = pathlib.PurePosixPath(member.name)
            if member.isfile() and name.suffix.lower() in (*SUFFIXES, ".zip") and ".." not in name.parts:
                target = folder / str(name).lstrip("/")
                target.parent.mkdir(parents=True, exist_ok=True)
                with members.extractfile(member) as source, open(target, "wb") as out:
                    shutil.copyfileobj(source, out)
                if name.suffix.lower() == ".zip" and zipfile.is_zipfile(target):
                    unpack_zip(target, target.with_name(name.name + ".unpacked"))


def unpack_zip(archive, folder):
    with zipfile.ZipFile(archive) as members:
        for member in members.infolist():
            name = pathlib.PurePosixPath(member.filename)
            # Bit 0: the member is encrypted.
            if name.suffix.lower() in SUFFIXES and ".." not in name.parts and not member.flag_bits & 1:
                target = folder / str(name).lstrip("/")
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(members.read(member))


def write_e57(folder, most=5, points=20_000):
    """Writes E57 files from the fetched LAS files with pye57, because source packages have none.

    Scans have poses and intensities, and colours if the LAS file has them.
    """
    try:
        import laspy
        import pye57
    except ImportError as error:
        print(f"no E57 files are written: {error}")
        return
    target = folder / "written" / "pye57"
    target.mkdir(parents=True, exist_ok=True)
    scans = []
    for path in sorted(folder.rglob("*.las")):
        try:
            data = laspy.read(path)
        except Exception:  # some files are damaged on purpose
            continue
        if 1 < len(data) <= points:
            values = {f"cartesian{axis}": np.asarray(data[axis.lower()], dtype=np.float64) for axis in "XYZ"}
            values["intensity"] = np.asarray(data.intensity, dtype=np.float32)
            if "red" in data.point_format.dimension_names:
                for name in ("Red", "Green", "Blue"):
                    values[f"color{name}"] = (np.asarray(data[name.lower()]) >> 8).astype(np.uint8)
            scans.append(values)
    turns = [np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.5, 0.5, -0.5, 0.5]), np.array([0.8, 0.0, 0.0, 0.6])]
    for number in range(min(most, len(scans))):
        path = target / f"{number}.e57"
        path.unlink(missing_ok=True)
        file = pye57.E57(str(path), mode="w")
        # The first file has one scan, the second two, and so on.
        for index, values in enumerate(scans[: number + 1]):
            file.write_scan_raw(values, rotation=turns[index % 3], translation=np.array([10.0 * index, -3.25, 0.5]))
        file.close()
