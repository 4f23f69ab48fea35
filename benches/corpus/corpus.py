#!/usr/bin/env python3
"""Compares how epsplat and a second reader read the test files of other programs.

There are two steps. `fetch` gets the source packages of other readers by name, from PyPI (with pip)
and from Debian (with apt-get source), and unpacks them into a folder. `check` runs epsplat on every
distinct PLY, LAS, LAZ, OBJ, E57 and PCD file below that folder, and compares its output with that
of a reader that shares no code with it:

    LAS, LAZ  laspy with lazrs          E57  pye57 (libE57Format)
    PLY       plyfile, or else trimesh  PCD  Open3D (no code of PCL's)
    OBJ       the `v` lines, read here

It compares the number of points, the bounding box, and whether there are colours and normals. For
files of up to --points points it also compares every coordinate, colour and given normal, by means
of the PLY that `epsplat surfels` writes.

It needs Python 3.11 or later on Linux, and: pip install laspy lazrs plyfile trimesh pye57 open3d
Open3D also needs the system's libusb-1.0. If the reader of any format found is missing, no file is
judged.

The fetched files do not belong in this repository.
"""

import argparse
import concurrent.futures
import dataclasses
import hashlib
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np

import fetch
from readers import MODULES, READERS, Cloud, srgb_to_light


def read(arguments):
    """Writes the Cloud of a second reader to a file, or an error to stderr.

    It runs as a separate process, because a reader may crash or never end.
    """
    reader = READERS[arguments.file.suffix.lower()][arguments.reader]
    try:
        cloud = dataclasses.asdict(reader(arguments.file, arguments.keep_withheld))
    except Exception as error:  # a second reader may throw anything, also if it is not installed
        print(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}", file=sys.stderr)
        return 3
    np.savez(arguments.output, **{key: value for key, value in cloud.items() if value is not None})
    return 0


def second_reading(file, options, folder):
    """Returns the Cloud of the first reader that succeeds, or None, and the others' errors."""
    complaints = []
    output = folder / "second.npz"
    for number, reader in enumerate(READERS[file.suffix.lower()]):
        command = [sys.executable, str(pathlib.Path(__file__).resolve()), "read", str(file), str(output), str(number)]
        command += ["--keep-withheld"] if options.keep_withheld else []
        name = reader.__name__.removeprefix("read_").replace("obj", "v lines")
        try:
            # Some readers are Python programs, and slow.
            limit = 5 * options.timeout
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=limit)
        except subprocess.TimeoutExpired:
            complaints.append(f"{name}: no answer in {limit:.0f} s")
            continue
        if done.returncode == 0:
            with np.load(output, allow_pickle=False) as data:
                fields = {key: data[key] if data[key].ndim else data[key].item() for key in data.files}
            output.unlink()
            return Cloud(**fields), "; ".join(complaints)
        lines = done.stderr.strip().splitlines() or ["no words"]
        complaints.append(f"{name}: {lines[-1]}" if done.returncode == 3 else f"{name}: ended with {done.returncode}")
    return None, "; ".join(complaints)


class Crash(Exception):
    """A crash, hang or panic, which no input may cause."""


class Refusal(Exception):
    """The error sentence of a run that failed in an orderly way."""


class Difference(Exception):
    """A disagreement of the two readers."""


def epsplat(options, *words):
    """Runs epsplat within limits and returns its output; raises Refusal or Crash."""

    def limit():
        # Each thread that decodes LAZ reserves 0.25 GiB of stack: address space, mostly unused.
        size = int((options.memory + 0.25 * os.cpu_count()) * 2**30)
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    command = [str(options.epsplat), *map(str, words)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=options.timeout,
                              stdin=subprocess.DEVNULL, preexec_fn=limit)
    except subprocess.TimeoutExpired:
        raise Crash(f"{words[0]}: no answer in {options.timeout:.0f} s") from None
    lines = done.stderr.strip().splitlines()
    if done.returncode not in (0, 1, 2):
        raise Crash(f"{words[0]}: exit code {done.returncode}: {' / '.join(lines[:3])}")
    if "panicked" in done.stderr:
        raise Crash(f"{words[0]}: the text of a panic: {' / '.join(lines[:3])}")
    if done.returncode != 0 and len(lines) != 1:
        raise Crash(f"{words[0]}: failed with {len(lines)} lines on stderr: {' / '.join(lines[:3])}")
    if done.returncode != 0:
        raise Refusal(lines[0].removeprefix("error: "))
    return done.stdout


# `epsplat info` reports these colours for a mesh whose colours are not on its vertices.
PAINTED = "of faces or materials"


def usable(positions):
    """Marks the positions that epsplat keeps: it drops those that are not finite or beyond 1e18."""
    with np.errstate(invalid="ignore"):
        return (np.abs(positions) <= 1e18).all(axis=1)


def compare_info(info, theirs):
    """Compares the output of `epsplat info` with the other reader's points."""
    kept = theirs.positions[usable(theirs.positions)]
    if info["points"] != len(theirs.positions):
        raise Difference(f"{info['points']} points, {theirs.reader} has {len(theirs.positions)}")
    # A mesh is drawn by surfels on its faces; compare_points compares its vertices.
    if not info.get("is_mesh") and info["preparation"]["surfels"] != len(kept):
        raise Difference(f"{info['preparation']['surfels']} usable points, {theirs.reader} has {len(kept)}")
    low, high = kept.min(axis=0), kept.max(axis=0)
    extent = (high - low).max()
    # epsplat computes the box from f32 coordinates relative to the origin.
    relative = np.maximum(np.abs(low - info["origin"]), np.abs(high - info["origin"]))
    tolerance = 1e-9 * extent + 2.0**-23 * relative
    if theirs.single:
        tolerance = tolerance + 2.0**-23 * np.maximum(np.abs(low), np.abs(high))
    for name, ours, other in (("min", info["min"], low), ("max", info["max"], high)):
        if (np.abs(np.array(ours) - other) > tolerance).any():
            raise Difference(f"the box's {name} is {list(ours)}, of {theirs.reader} {other.tolist()}")
    if info["colors"] == PAINTED:
        return compare_normals(info, theirs)
    # Greys made from intensities do not count as colours.
    colored = (theirs.codes is not None or theirs.light is not None) and not theirs.made
    if (info["colors"] != "none") != colored:
        raise Difference(f"colours: {info['colors']}, {theirs.reader} has {'some' if colored else 'none'}")
    compare_normals(info, theirs)


def compare_normals(info, theirs):
    """Compares whether there are normals."""
    normals = theirs.normals is not None or theirs.faces
    if info["normals"] != normals:
        raise Difference(f"normals: {info['normals']}, {theirs.reader}: {normals}")


def compare_points(output, theirs, colors):
    """Compares every point of the PLY from `epsplat surfels` with the other reader's points.

    Both are in the file's order. `colors` says whether colours are compared too.
    """
    import plyfile

    table = plyfile.PlyData.read(output)["vertex"].data
    column = lambda names: np.column_stack([np.asarray(table[name], dtype=np.float64) for name in names])
    kept = usable(theirs.positions)
    expected, ours = theirs.positions[kept], column("xyz")
    if len(ours) != len(expected):
        raise Difference(f"surfels: {len(ours)} points, {theirs.reader} has {len(expected)}")
    extent = (expected.max(axis=0) - expected.min(axis=0)).max()
    tolerance = 1e-9 * extent + np.abs(expected) * (2.0**-23 if theirs.single else 2.0**-50)
    off = np.abs(ours - expected) > tolerance
    if off.any():
        row, count = int(off.any(axis=1).argmax()), int(off.any(axis=1).sum())
        raise Difference(f"point {row}, and {count} in all: {ours[row]}, {theirs.reader}: {expected[row]}")
    names = table.dtype.names
    if "red" in names and colors:
        rgb = column(("red", "green", "blue"))
        eight_bit = table["red"].dtype == np.uint8
        if theirs.codes is not None:
            codes = theirs.codes[kept][:, :3]
            light = srgb_to_light(codes / 255.0)
            off = np.abs(rgb - codes) > int(theirs.made) if eight_bit else np.abs(rgb - light) > 1e-6
        else:
            light = theirs.light[kept][:, :3]
            rgb = srgb_to_light(rgb / 255.0) if eight_bit else rgb
            # A point without a colour gets the default, which is not compared.
            off = np.abs(rgb - light) > 1e-6 * np.maximum(1.0, np.abs(light))
        if off.any():
            row = int(off.any(axis=1).argmax())
            other = (theirs.codes if theirs.codes is not None else theirs.light)[kept][row]
            count = int(off.any(axis=1).sum())
            raise Difference(f"the colour of point {row}, and of {count} in all: {rgb[row]}, {theirs.reader}: {other}")
    if theirs.normals is not None:
        given = theirs.normals[kept].astype(np.float32).astype(np.float64)
        length = np.linalg.norm(given, axis=1)
        has = np.isfinite(length) & (length > 0)
        mine = column(("nx", "ny", "nz"))[has]
        cosine = (mine * given[has]).sum(axis=1) / (np.linalg.norm(mine, axis=1) * length[has])
        if (cosine < 1 - 1e-6).any():
            row = int((cosine < 1 - 1e-6).argmax())
            raise Difference(f"a given normal became {mine[row]}, {theirs.reader}: {given[has][row]}")


def compare(file, options, theirs, folder):
    """Compares all that both readers report of a file, and returns a remark, which may be empty."""
    flags = ["--keep-withheld"] if options.keep_withheld and file.suffix.lower() in (".las", ".laz") else []
    info = json.loads(epsplat(options, "info", file, "--json", "-", *flags))
    compare_info(info, theirs)
    # The second readers read only vertex colours.
    colors = info["colors"] != PAINTED
    faults = ("count", "box", "colours", "normals") if colors else ("count", "box", "normals")
    check_control(theirs, lambda altered: compare_info(info, altered), faults)
    if flags and theirs.withheld:
        without = json.loads(epsplat(options, "info", file, "--json", "-"))
        told = without["preparation"]["withheld"]
        if (without["points"], told) != (len(theirs.positions) - theirs.withheld, theirs.withheld):
            raise Difference(f"{told} points are told to be withheld and {without['points']} not, in {theirs.reader} "
                             f"{theirs.withheld} of {len(theirs.positions)} are")
    remark = [f"{theirs.withheld} withheld"] if theirs.withheld else []
    if info["points"] > options.points:
        return ", ".join(remark + ["points not compared one by one"])
    output = folder / "surfels.ply"
    epsplat(options, "surfels", file, "-o", output, *flags)
    compare_points(output, theirs, colors)
    faults = ("point", "colour") if colors else ("point",)
    check_control(theirs, lambda altered: compare_points(output, altered, colors), faults)
    return ", ".join(remark)


def check_control(theirs, comparison, faults):
    """The control of a comparison: it must fail if the other reader's points get a fault."""
    kept = usable(theirs.positions)
    row = int(kept.nonzero()[0][kept.sum() // 2])
    for fault in faults:
        altered = dataclasses.replace(theirs, positions=theirs.positions.copy())
        size = np.abs(theirs.positions[kept]).max() or 1.0
        if fault == "count":
            altered.positions = altered.positions[:-1]
        elif fault == "box":
            altered.positions[:, 1] += 1e-5 * size
        elif fault == "point":
            altered.positions[row, 2] += 1e-5 * size
        elif fault == "colours":
            colored = (theirs.codes is not None or theirs.light is not None) and not theirs.made
            altered.codes, altered.made = None if colored else np.zeros((len(kept), 3)), False
            altered.light = None
        elif fault == "normals":
            altered.normals, altered.faces = None, theirs.normals is None and not theirs.faces
        elif theirs.codes is not None:
            altered.codes = theirs.codes.copy()
            altered.codes[row, 1] ^= 0x42
        elif theirs.light is not None and np.isfinite(theirs.light[row, 1]):
            altered.light = theirs.light.copy()
            altered.light[row, 1] += 1e-3 * max(1.0, abs(theirs.light[row, 1]))
        else:
            continue
        try:
            comparison(altered)
        except Difference:
            continue
        raise Crash(f"the comparison does not notice a fault that was put in on purpose: {fault}")


def judge(file, options):
    """Returns the verdict on a file, its details, and the other reader's number of points."""
    short = lambda refusal: str(refusal).removeprefix(f"{file}: ")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        theirs, complaint = second_reading(file, options, folder)
        count = None if theirs is None else len(theirs.positions)
        try:
            if theirs is None:
                info = json.loads(epsplat(options, "info", file, "--json", "-"))
                return "they refuse, we read", f"we: {info['points']} points; they: {complaint}", info["points"]
            if not usable(theirs.positions).any():
                epsplat(options, "info", file)
                return "differ", f"we read points, {theirs.reader} has none that can be used", count
            return "equal", compare(file, options, theirs, folder), count
        except Crash as crash:
            return "crash", str(crash), count
        except Difference as difference:
            return "differ", str(difference), count
        except Refusal as refusal:
            if theirs is None:
                return "both refuse", f"we: {short(refusal)}; they: {complaint}", None
            if not usable(theirs.positions).any() and "nothing to draw" in str(refusal):
                return "equal", f"nothing to draw: {count} points, none of use", count
            return "we refuse, they read", f"we: {short(refusal)}; {theirs.reader}: {count} points", count


VERDICTS = ("equal", "both refuse", "we refuse, they read", "they refuse, we read", "differ", "crash")


def check(arguments):
    """Judges every distinct file, and returns 1 if any differs or crashes."""
    arguments.epsplat = arguments.epsplat.resolve()
    help_text = subprocess.run([str(arguments.epsplat), "info", "--help"], capture_output=True, text=True).stdout
    arguments.keep_withheld = "--keep-withheld" in help_text
    found, repeated = {}, 0
    ours = lambda path: path.suffix.lower() in fetch.SUFFIXES and path.is_file()
    for file in sorted(filter(ours, arguments.folder.rglob("*"))):
        with open(file, "rb") as source:
            digest = hashlib.file_digest(source, "sha256").hexdigest()
        repeated += digest in found
        found.setdefault(digest, file)
    if not found:
        print(f"{arguments.folder} holds no file of ours; `fetch` gets some", file=sys.stderr)
        return 2
    modules = {module for file in found.values() for module in MODULES[file.suffix.lower()]}
    problem = {module: fetch.run_quietly([sys.executable, "-c", f"import {module}"]) for module in sorted(modules)}
    absent = [f"{module}: {why}" for module, why in problem.items() if why]
    if absent:
        print(f"second readers that cannot be had: {'; '.join(absent)}", file=sys.stderr)
        return 2
    rows = []
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        judged = pool.map(lambda file: judge(file, arguments), found.values())
        for (digest, file), (verdict, detail, count) in zip(found.items(), judged):
            path = file.relative_to(arguments.folder)
            rows.append({"path": str(path), "sha256": digest, "verdict": verdict, "detail": detail, "points": count})
            if arguments.all or verdict != "equal":
                print(f"{verdict:<21} {path}\n    {detail or count}", flush=True)
    print_table(rows)
    counts = {verdict: sum(row["verdict"] == verdict for row in rows) for verdict in VERDICTS}
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    print(f"{len(rows)} distinct files ({repeated} repeat others): {summary}")
    if arguments.json:
        arguments.json.write_text(json.dumps({"counts": counts, "files": rows}, indent=1) + "\n")
    return 1 if counts["differ"] + counts["crash"] > 0 else 0


def print_table(rows):
    """Prints the number of files per package and format, and how many of them are equal."""
    groups = {}
    for row in rows:
        parts = pathlib.Path(row["path"]).parts
        package = "/".join(parts[:2]) if parts[0] in ("pypi", "debian") else parts[0]
        groups.setdefault(package, []).append(row)
    print(f"\n{'package':<26}" + "".join(f"{suffix[1:]:>10}" for suffix in fetch.SUFFIXES) + "   (equal/all)")
    for package, of_package in [*sorted(groups.items()), ("all", rows)]:
        cells = []
        for suffix in fetch.SUFFIXES:
            verdicts = [row["verdict"] for row in of_package if row["path"].lower().endswith(suffix)]
            cells.append(f"{verdicts.count('equal')}/{len(verdicts)}" if verdicts else "")
        print(f"{package:<26}" + "".join(f"{cell:>10}" for cell in cells))


def main():
    parser = argparse.ArgumentParser(
        description="The test files of other programs, each read by epsplat and by a second reader, and compared.",
        epilog="Example:\n  python3 corpus.py fetch /tmp/corpus\n"
        "  python3 corpus.py check /tmp/corpus --epsplat target/release/epsplat",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="fetch|check")
    fetching = commands.add_parser("fetch", help="get and unpack source packages by name")
    fetching.add_argument("folder", type=pathlib.Path, help="where they are unpacked")
    fetching.add_argument("--pypi", nargs="*", default=fetch.PYPI, metavar="NAME[==VERSION]",
                          help=f"default: {' '.join(fetch.PYPI)}")
    fetching.add_argument("--debian", nargs="*", default=fetch.DEBIAN, metavar="NAME[/SUITE]",
                          help=f"default: {' '.join(fetch.DEBIAN)}")
    fetching.add_argument("--suites", nargs="+", default=fetch.SUITES, metavar="SUITE",
                          help=f"where Debian packages are looked for (default: {' '.join(fetch.SUITES)})")
    fetching.add_argument("--no-e57", dest="e57", action="store_false", help="have no E57 files written")
    fetching.set_defaults(run=fetch.fetch)
    checking = commands.add_parser("check", help="compare what epsplat and the second readers make of each file")
    checking.add_argument("folder", type=pathlib.Path, help="every file below it")
    checking.add_argument("--epsplat", type=pathlib.Path, required=True, help="the program, built with all features")
    checking.add_argument("--json", type=pathlib.Path, metavar="FILE", help="every file with its verdict")
    checking.add_argument("--all", action="store_true", help="list files that are equal too")
    checking.add_argument("--points", type=int, default=1_000_000, metavar="N",
                          help="files of more points are compared by count and box alone (default: 1000000)")
    checking.add_argument("--timeout", type=float, default=60.0, metavar="S",
                          help="seconds a run may take (default: 60)")
    checking.add_argument("--memory", type=float, default=8.0, metavar="GIB", help="GiB a run may take (default: 8)")
    checking.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N",
                          help="files at once (default: cores)")
    checking.set_defaults(run=check)
    reading = commands.add_parser("read")
    reading.add_argument("file", type=pathlib.Path)
    reading.add_argument("output", type=pathlib.Path)
    reading.add_argument("reader", type=int)
    reading.add_argument("--keep-withheld", action="store_true")
    reading.set_defaults(run=read)
    arguments = parser.parse_args()
    return arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(main())
