"""The second readers: programs that share no code with epsplat."""

import dataclasses

import numpy as np


@dataclasses.dataclass
class Cloud:
    """The points that a reader finds in a file, in the file's order."""

    reader: str
    positions: np.ndarray
    # Rows of 8-bit sRGB (`codes`) if the file has that, else of linear light. None: no colours.
    codes: np.ndarray | None = None
    light: np.ndarray | None = None
    # Normals in the file. A mesh's normals come from its faces, so they are not compared.
    normals: np.ndarray | None = None
    faces: bool = False
    # Whether the reader keeps coordinates as f32, and so may be off by its rounding.
    single: bool = False
    withheld: int = 0
    # Whether the codes are greys made from intensities, which may differ by one rounding.
    made: bool = False


def srgb_to_light(share):
    share = np.asarray(share, dtype=np.float64)
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def grey_of(intensities):
    """Returns the greys that epsplat documents for files without colours, or None.

    The 99.9th percentile is white. Zero is black, or the 0.1th percentile if some intensities are
    negative. A single value gives no colour.
    """
    values = intensities.astype(np.float64)
    finite = np.sort(values[np.isfinite(values)])
    if len(finite) == 0 or finite[0] == finite[-1]:
        return None
    at = lambda share: finite[max(int(np.ceil(share * len(finite))), 1) - 1]
    black = at(0.001) if finite[0] < 0 else 0.0
    white = at(0.999)
    if white <= black:
        white = finite[finite > black][0]
    # Like Rust's `round` (halves away from zero) and `as u8` (saturating).
    shares = np.nan_to_num((values - black) / (white - black), posinf=1.0, neginf=0.0)
    grey = np.clip(np.floor(shares * 255.0 + 0.5), 0, 255).astype(np.uint8)
    return np.column_stack([grey, grey, grey])


def ranged(rgb, integer, largest=65535, limits=None, light=False):
    """Returns rows as 8-bit codes or as light; guesses their range as README and the source say."""
    values = rgb[np.isfinite(rgb)]
    values = values[values != 0].astype(np.float64)
    few = lambda outliers: 100 * outliers <= len(values)
    above = lambda limit: int((values > limit).sum())
    whole = bool((values % 1 == 0).all())
    widened = any(few(int((values % factor != 0).sum())) for factor in (256, 257))
    codes = lambda of: (np.clip(np.nan_to_num(of), 0, 255).astype(np.uint8), None)
    linear = lambda low, high: (None, srgb_to_light((rgb.astype(np.float64) - low) / (high - low)))
    if limits is not None:
        low, high = np.array(limits, dtype=np.float64).reshape(2, -1)
        outside = ((rgb < low) | (rgb > high)).sum()
        wide = (low == 0).all() and high.max() >= 4095 and few(above(255))
        if 100 * outside <= np.isfinite(rgb).sum() and not wide and not (not integer and (high == 1).all()):
            if (low == 0).all() and (high == 255).all() and whole:
                return codes(rgb)
            if (low == 0).all() and (high == 65535).all() and widened:
                return codes(rgb // 256)
            return linear(low, high)
    if integer:
        if few(above(255)):
            return codes(rgb)
        if few(above(65535)):
            return codes(rgb // 256) if widened else linear(0, 65535)
        return linear(0, largest)
    shares = int(((values > 0) & (values < 1)).sum())
    if values.max(initial=0.0) < 2 or above(1) <= shares:
        return (None, rgb.astype(np.float64)) if light else linear(0, 1)
    if few(above(255)):
        return codes(rgb) if whole else linear(0, 255)
    return linear(0, 65535)


def read_las(path, keep_withheld):
    import laspy

    data = laspy.read(path)
    withheld = np.asarray(data.withheld).astype(bool)
    kept = np.full(len(withheld), True) if keep_withheld else ~withheld
    positions = np.column_stack([np.asarray(axis, dtype=np.float64) for axis in (data.x, data.y, data.z)])[kept]
    cloud = Cloud("laspy", positions, withheld=int(withheld.sum()))
    names = set(data.point_format.dimension_names)
    if {"red", "green", "blue"} <= names:
        # The format does not say whether codes have 8 or 16 bits.
        rgb = np.column_stack([np.asarray(data[name]) for name in ("red", "green", "blue")])[kept]
        if rgb.any():
            cloud.codes, cloud.light = ranged(rgb, True)
            return cloud
    cloud.codes, cloud.made = grey_of(np.asarray(data.intensity)[kept]), True
    return cloud


PLY_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
PLY_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"), ("normalx", "normaly", "normalz"))
PLY_INTENSITIES = ("intensity", "intensities", "reflectance", "reflectivity", "amplitude", "remission", "gray", "grey")


def read_ply(path, _):
    import plyfile

    # plyfile reads binary files with lists row by row in Python, unless it knows the lists'
    # lengths.
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
        channels = np.column_stack([np.asarray(table[name]) for name in triple])
        kind = max((np.asarray(table[name]).dtype for name in triple), key=lambda kind: (kind.kind == "f", kind.itemsize))
        if kind == np.uint8:
            cloud.codes = channels.astype(np.uint8)
        elif kind.kind == "f" and any(line.startswith("epsplat ") for line in data.comments):
            cloud.light = channels.astype(np.float64)
        else:
            largest = 2**32 - 1 if kind.itemsize == 4 else 65535
            cloud.codes, cloud.light = ranged(channels, kind.kind != "f", largest, light=True)
        break
    shades = next((name for name in names if name.lower().removeprefix("scalar_") in PLY_INTENSITIES), None)
    shown = cloud.codes if cloud.codes is not None else cloud.light
    if shades is not None and (shown is None or not np.nan_to_num(shown).any()):
        grey = grey_of(np.asarray(table[shades]).astype(np.float32))
        if grey is not None:
            cloud.codes, cloud.light, cloud.made = grey, None, True
    for element in data.elements:
        lists = [p.name for p in element.properties if p.name in ("vertex_indices", "vertex_index")]
        if element.name in ("face", "tristrips") and lists:
            cloud.faces |= any(len(row) > 2 for row in element.data[lists[0]])
    return cloud


def read_trimesh(path, _):
    """Reads files that plyfile cannot. trimesh invents colours and normals, so they are unused."""
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
        cloud.codes = grey_of(attributes["intensity"].numpy().reshape(-1).astype(np.float32))
        cloud.made = True
    return cloud


def read_obj(path, _):
    """Reads an OBJ's `v` lines: x y z, then nothing, a weight, or a colour (with alpha or not)."""
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
        cloud.codes, cloud.light = ranged(colors, False)
        if cloud.codes is not None and not np.isfinite(colors).all():
            # Codes have no NaN for vertices without a colour, which are not compared.
            cloud.codes, cloud.light = None, srgb_to_light(colors / 255.0)
    if not faces and len(normals) == len(positions) > 0:
        cloud.normals = np.array(normals)
    return cloud


def number_in_text(word):
    """Parses a number as C writes it, with Microsoft's 1.#INF, and 1.#IND for NaN."""
    if b".#" in word:
        return float("-inf" if word.startswith(b"-") else "inf") if b"#INF" in word else float("nan")
    return float(word)


def read_e57(path, _):
    """Reads all scans with their poses, and every field as f64, so that no precision is lost."""
    import pye57
    from pye57.utils import get_fields, get_node

    file = pye57.E57(str(path))
    positions, scans = [], []
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
        rgb, range_of = np.full((count, 3), np.nan), None
        if set(channels) <= present:
            rgb = np.column_stack([columns[name] for name in channels])
            rgb[marked[1]] = np.nan
            ranges = [e57_range(scan, get_node(prototype, name), name) for name in channels]
            integer = all(isinstance(get_node(prototype, name), pye57.libe57.IntegerNode) for name in channels)
            limits = None if None in ranges else tuple(zip(*ranges))
            range_of = (integer, limits)
        strength = np.where(marked[2], 0, columns.get("intensity", np.zeros(count)))
        scans.append((range_of, rgb[kept], strength[kept].astype(np.float32), "intensity" in present))
    if not positions:
        return Cloud("pye57", np.zeros((0, 3)))
    cloud = Cloud("pye57", np.concatenate(positions))
    shown = [np.isfinite(rgb).any() and (np.nan_to_num(rgb).any() or not has) for _, rgb, _, has in scans]
    shaded = [has and not shows for shows, (_, _, _, has) in zip(shown, scans)]
    grey = grey_of(np.concatenate([strength for (_, _, strength, _), on in zip(scans, shaded) if on])) if any(shaded) else None
    if not any(shown):
        cloud.codes, cloud.made = grey if all(shaded) else None, True
        return cloud
    light, at = [np.full((len(rgb), 3), np.nan) for _, rgb, _, _ in scans], 0
    for range_of in {scan[0] for scan, shows in zip(scans, shown) if shows}:
        own = [k for k, (scan, shows) in enumerate(zip(scans, shown)) if shows and scan[0] == range_of]
        together = np.concatenate([scans[k][1] for k in own])
        codes, of_all = ranged(together, range_of[0], limits=range_of[1])
        if codes is not None:
            of_all = np.where(np.isfinite(together), srgb_to_light(codes / 255.0), np.nan)
        parts = np.split(of_all, np.cumsum([len(scans[k][1]) for k in own])[:-1])
        for k, part in zip(own, parts):
            light[k] = part
    cloud.light = np.concatenate(light)
    return cloud


def e57_places(columns, axes, scan):
    """Returns Cartesian coordinates in the file's coordinate system."""
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
    """Returns the limits of a colour channel: the scan's, else the type's, or None for floats."""
    limits = [f"colorLimits/{name}{end}" for end in ("Minimum", "Maximum")]
    if all(scan.isDefined(limit) for limit in limits):
        low, high = (float(scan[limit].value()) for limit in limits)
        if low < high:
            return low, high
    if hasattr(prototype, "scale"):
        return prototype.scaledMinimum(), prototype.scaledMaximum()
    low, high = float(prototype.minimum()), float(prototype.maximum())
    return (low, high) if 0 < high - low < 1e9 else None


# The second readers of each format; the first one that can read the file is used.
READERS = {
    ".las": [read_las],
    ".laz": [read_las],
    ".ply": [read_ply, read_trimesh],
    ".obj": [read_obj],
    ".e57": [read_e57],
    ".pcd": [read_open3d],
}
# The modules that each format needs; plyfile reads the surfels.
MODULES = {
    ".las": ["plyfile", "laspy", "lazrs"],
    ".laz": ["plyfile", "laspy", "lazrs"],
    ".ply": ["plyfile", "trimesh"],
    ".obj": ["plyfile"],
    ".e57": ["plyfile", "pye57"],
    ".pcd": ["plyfile", "open3d"],
}
