"""The second readers: what programs that share no code with epsplat make of a file."""

import dataclasses

import numpy as np


@dataclasses.dataclass
class Cloud:
    """What a reader makes of a file, in the file's order."""

    reader: str
    positions: np.ndarray
    # Rows of what is 8-bit sRGB in the file, or else of linear light. None: no colours.
    codes: np.ndarray | None = None
    light: np.ndarray | None = None
    # Normals that the file gives. Those of a mesh are made of its faces, so that there is nothing to compare.
    normals: np.ndarray | None = None
    faces: bool = False
    # How far this reader's coordinates may be off: it keeps them as f32.
    single: bool = False
    withheld: int = 0
    # The codes are not the file's, but greys made of intensities: a rounding may go either way.
    made: bool = False


def srgb_to_light(share):
    share = np.asarray(share, dtype=np.float64)
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def grey_of(intensities):
    """Greys as documented for files without colours: the 99.9th percentile is white, and one value alone no colour."""
    if len(np.unique(intensities)) < 2:
        return None
    rank = int(np.ceil(0.999 * len(intensities)))
    white = max(int(np.sort(intensities)[rank - 1]), 1)
    # Rust's round, halves away from zero, and its cast, which keeps within the type.
    grey = np.clip(np.floor(intensities.astype(np.float64) / white * 255.0 + 0.5), 0, 255).astype(np.uint8)
    return np.column_stack([grey, grey, grey])


def codes_of_intensities(intensities):
    finite = intensities[np.isfinite(intensities)]
    largest = float(finite.max()) if len(finite) else 0.0
    if largest <= 0.0:
        return np.zeros(len(intensities), dtype=np.uint16)
    codes = np.floor(np.nan_to_num(intensities.astype(np.float64), posinf=largest) / largest * 65535.0 + 0.5)
    return np.clip(codes, 0, 65535).astype(np.uint16)


def read_las(path, keep_withheld):
    import laspy

    data = laspy.read(path)
    withheld = np.asarray(data.withheld).astype(bool)
    kept = np.full(len(withheld), True) if keep_withheld else ~withheld
    positions = np.column_stack([np.asarray(axis, dtype=np.float64) for axis in (data.x, data.y, data.z)])[kept]
    cloud = Cloud("laspy", positions, withheld=int(withheld.sum()))
    names = set(data.point_format.dimension_names)
    if {"red", "green", "blue"} <= names:
        # What the codes mean the format leaves open; the README says how it is decided.
        rgb = np.column_stack([np.asarray(data[name]) for name in ("red", "green", "blue")])[kept]
        largest = int(rgb.max(initial=0))
        if 0 < largest <= 255:
            cloud.codes = rgb.astype(np.uint8)
        elif largest > 0 and ((rgb % 257 == 0).all() or (rgb % 256 == 0).all()):
            cloud.codes = (rgb >> 8).astype(np.uint8)
        elif largest > 0:
            cloud.light = srgb_to_light(rgb / 65535.0)
    else:
        cloud.codes, cloud.made = grey_of(np.asarray(data.intensity)[kept]), True
    return cloud


PLY_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
PLY_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))


def read_ply(path, _):
    import plyfile

    # Without a list's length known beforehand binary files are read row by row, in Python.
    data = plyfile.PlyData.read(path)
    vertex = data["vertex"]
    names = [property.name for property in vertex.properties]
    table = vertex.data
    cloud = Cloud("plyfile", np.column_stack([np.asarray(table[name], dtype=np.float64) for name in "xyz"]))
    cloud.single = data.text and any(table[name].dtype == np.float32 for name in "xyz")
    for triple in PLY_NORMALS:
        if cloud.normals is None and set(triple) <= set(names):
            cloud.normals = np.column_stack([np.asarray(table[name], dtype=np.float64) for name in triple])
    for triple in PLY_COLORS:
        if not set(triple) <= set(names):
            continue
        channels = [np.asarray(table[name]) for name in triple]
        kind = channels[0].dtype
        if kind.kind == "f":
            cloud.light = np.column_stack(channels).astype(np.float64)
        elif kind == np.uint16:
            cloud.light = srgb_to_light(np.column_stack(channels) / 65535.0)
        else:
            cloud.codes = np.clip(np.column_stack(channels), 0, 255).astype(np.uint8)
        break
    for element in data.elements:
        lists = [p.name for p in element.properties if p.name in ("vertex_indices", "vertex_index")]
        if element.name in ("face", "tristrips") and lists:
            cloud.faces |= any(len(row) > 2 for row in element.data[lists[0]])
    return cloud


def read_trimesh(path, _):
    """For what plyfile cannot read. What it would say of colours and normals is its own, not the file's."""
    import trimesh

    data = trimesh.load(str(path), process=False)
    cloud = Cloud("trimesh", np.asarray(data.vertices, dtype=np.float64), single=True)
    cloud.faces = len(getattr(data, "faces", ())) > 0
    return cloud


def read_open3d(path, _):
    import open3d

    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    data = open3d.io.read_point_cloud(str(path), remove_nan_points=False, remove_infinite_points=False)
    positions = np.asarray(data.points)
    if len(positions) == 0:
        raise ValueError("no points are read")
    cloud = Cloud("Open3D", positions, single=True)
    if data.has_normals():
        cloud.normals = np.asarray(data.normals)
    if data.has_colors():
        cloud.codes = np.floor(np.asarray(data.colors) * 255.0 + 0.5).astype(np.uint8)
        return cloud
    attributes = open3d.t.io.read_point_cloud(str(path)).point
    if "intensity" in attributes and len(attributes["intensity"]) == len(positions):
        cloud.codes = grey_of(codes_of_intensities(attributes["intensity"].numpy().reshape(-1)))
        cloud.made = True
    return cloud


def read_obj(path, _):
    """The lines `v` of an OBJ file: x y z, then nothing, a weight, or a colour with or without alpha."""
    positions, colors, normals, faces = [], [], [], False
    text = path.read_bytes()
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = text.decode("utf-16").encode()
    text = text.removeprefix(b"\xef\xbb\xbf").replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for line in text.split(b"\n"):
        words = line.split()
        comment = next((place for place, word in enumerate(words) if word.startswith(b"#")), len(words))
        keyword, words = words[:1], words[1:comment]
        if keyword == [b"f"] and len(words) > 2:
            faces = True
        elif keyword == [b"vn"]:
            normals.append([number_in_text(word) for word in words[:3]])
        elif keyword == [b"v"]:
            numbers = [number_in_text(word) for word in words]
            if len(numbers) < 3:
                raise ValueError("a vertex has fewer than three coordinates")
            weight = numbers[3] if len(numbers) == 4 else 1.0
            positions.append([number / weight for number in numbers[:3]])
            colors.append(numbers[3:6] if len(numbers) in (6, 7) else [np.nan] * 3)
    cloud = Cloud("v lines", np.array(positions, dtype=np.float64).reshape(-1, 3), faces=faces)
    colors = np.array(colors, dtype=np.float64).reshape(-1, 3)
    if np.isfinite(colors).any():
        cloud.light = srgb_to_light(colors / (255.0 if np.nanmax(colors) >= 2.0 else 1.0))
    if not faces and len(normals) == len(positions) > 0:
        cloud.normals = np.array(normals)
    return cloud


def number_in_text(word):
    """What C writes, Microsoft's among them: 1.#INF, and 1.#IND for no number."""
    if b".#" in word:
        return float("-inf" if word.startswith(b"-") else "inf") if b"#INF" in word else float("nan")
    return float(word)


def read_e57(path, _):
    """All scans, each with its pose; every field as f64, so that nothing is narrowed on the way."""
    import pye57
    from pye57.utils import get_fields, get_node

    file = pye57.E57(str(path))
    positions, colors, intensities = [], [], []
    for scan in file.data3d:
        points = get_node(scan, "points")
        prototype = pye57.libe57.StructureNode(points.prototype())
        present = set(get_fields(prototype))
        axes = [f"cartesian{axis}" for axis in "XYZ"]
        if not set(axes) <= present:
            axes = ["sphericalRange", "sphericalAzimuth", "sphericalElevation"]
        channels = ["colorRed", "colorGreen", "colorBlue"]
        system = "cartesian" if axes[0] == "cartesianX" else "spherical"
        flags = [f"{system}InvalidState", "isColorInvalid", "isIntensityInvalid"]
        count = points.childCount()
        columns, buffers = {}, pye57.libe57.VectorSourceDestBuffer()
        for name in [*axes, *channels, "intensity", *flags]:
            if name in present:
                columns[name] = np.zeros(count)
                buffers.append(pye57.libe57.SourceDestBuffer(file.image_file, name, columns[name], count, True, True))
        if count:
            points.reader(buffers).read()
        marked = [columns.get(flag, np.zeros(count)) != 0 for flag in flags]
        kept = ~marked[0]
        positions.append(e57_places([columns[name] for name in axes], axes, scan)[kept])
        rgb = np.full((count, 3), np.nan)
        if set(channels) <= present:
            for channel, name in enumerate(channels):
                low, high = e57_range(scan, get_node(prototype, name), name)
                rgb[:, channel] = np.clip((columns[name] - low) / (high - low), 0, 1)
            rgb[marked[1]] = np.nan
        colors.append(rgb[kept])
        strength = np.where(marked[2], 0, columns.get("intensity", np.zeros(count)))
        intensities.append(strength[kept].astype(np.float32))
    if not positions:
        return Cloud("pye57", np.zeros((0, 3)))
    cloud = Cloud("pye57", np.concatenate(positions))
    colors = np.concatenate(colors)
    if np.isfinite(colors).any():
        cloud.light = srgb_to_light(colors)
    elif len(colors):
        cloud.codes, cloud.made = grey_of(codes_of_intensities(np.concatenate(intensities))), True
    return cloud


def e57_places(columns, axes, scan):
    """Cartesian coordinates in the file's own system."""
    a, b, c = columns
    if axes[0] == "sphericalRange":
        a, b, c = a * np.cos(c) * np.cos(b), a * np.cos(c) * np.sin(b), a * np.sin(c)
    local = np.column_stack([a, b, c])
    if not scan.isDefined("pose"):
        return local
    value = lambda path, default: scan[path].value() if scan.isDefined(path) else default
    w, x, y, z = (value(f"pose/rotation/{part}", float(part == "w")) for part in "wxyz")
    length = (w * w + x * x + y * y + z * z) ** 0.5
    w, x, y, z = w / length, x / length, y / length, z / length
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    return local @ rotation.T + np.array([value(f"pose/translation/{axis}", 0.0) for axis in "xyz"])


def e57_range(scan, prototype, name):
    """Smallest and largest value of a colour channel: those that the scan gives, or else those of the type."""
    limits = [f"colorLimits/{name}{end}" for end in ("Minimum", "Maximum")]
    if all(scan.isDefined(limit) for limit in limits):
        low, high = (float(scan[limit].value()) for limit in limits)
        if low < high:
            return low, high
    if hasattr(prototype, "scale"):
        return prototype.scaledMinimum(), prototype.scaledMaximum()
    low, high = float(prototype.minimum()), float(prototype.maximum())
    return (low, high) if 0 < high - low < 1e9 else (0.0, 1.0)


# The second readers of each format: the first that reads the file is asked.
READERS = {
    ".las": [read_las],
    ".laz": [read_las],
    ".ply": [read_ply, read_trimesh],
    ".obj": [read_obj],
    ".e57": [read_e57],
    ".pcd": [read_open3d],
}
# What they import, and with plyfile what reads the surfels.
MODULES = {
    ".las": ["plyfile", "laspy", "lazrs"],
    ".laz": ["plyfile", "laspy", "lazrs"],
    ".ply": ["plyfile", "trimesh"],
    ".obj": ["plyfile"],
    ".e57": ["plyfile", "pye57"],
    ".pcd": ["plyfile", "open3d"],
}
