"""Point Cloud Data files, as the Point Cloud Library writes them (pointclouds.org, "The PCD file format", 0.7).

Padding (fields named `_`, and fields of count 0) is skipped, as PCL does; fields of several values are left out.
"""

from __future__ import annotations

import numpy as np

from cosim.point_files.scan import PointFileError

_KINDS = {"F": "f", "U": "u", "I": "i"}
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_IDENTITY, _SAME = (0, 0, 0, 1, 0, 0, 0), 1e-6  # translation and quaternion (w first) of VIEWPOINT
_LONGEST_HEADER = 65_536


def read_pcd(data: bytes, source: str) -> dict[str, np.ndarray]:
    """The single-valued fields of a file, (n,) each.

    Raises:
        PointFileError: no such header, a value of it is not possible, or fewer points than it says.
    """
    header, body = _header(data, source)
    names = header["FIELDS"]
    sizes, types = _whole(header, "SIZE", source), header.get("TYPE", [])
    counts = _whole(header, "COUNT", source) if "COUNT" in header else [1] * len(names)
    if not len(names) == len(sizes) == len(types) == len(counts):
        raise PointFileError(
            f"{source}: {len(names)} FIELDS, {len(sizes)} SIZE, {len(types)} TYPE, {len(counts)} COUNT; give one each"
        )
    _demand_sensor_origin(header, source)
    type_names = [_kind(*item, source) for item in zip(names, types, sizes, strict=True)]
    points = _points(header, source)
    form = header["DATA"][0].lower()
    if form == "ascii":
        return _text(body, names, type_names, counts, points, source)
    row = np.dtype([(f"f{n}", kind, (count,)) for n, (kind, count) in enumerate(zip(type_names, counts, strict=True))])
    if form == "binary":
        if len(body) < points * row.itemsize:
            raise _short(source, len(body) // row.itemsize if row.itemsize else 0, points)
        table = np.frombuffer(body, row, points)
        columns = [table[f"f{n}"] for n in range(len(names))]
    elif form == "binary_compressed":
        columns = _unpacked(body, type_names, counts, points, source)
    else:
        raise PointFileError(f"{source}: DATA {form!r}; it is ascii, binary or binary_compressed")
    return _named(names, counts, columns)


def _header(data: bytes, source: str) -> tuple[dict[str, list[str]], bytes]:
    header: dict[str, list[str]] = {}
    position = 0
    while "DATA" not in header:
        end = data.find(b"\n", position, position + _LONGEST_HEADER)
        if end < 0:
            raise PointFileError(f"{source}: the header of a PCD file ends with a line DATA; there is none")
        words = data[position:end].decode("ascii", "replace").split()
        position = end + 1
        if not words or words[0].startswith("#"):
            continue
        key = "FIELDS" if words[0].upper() == "COLUMNS" else words[0].upper()
        if key not in _KEYS:
            raise PointFileError(f"{source}: {words[0][:40]!r} in the header; a PCD file has {', '.join(_KEYS)}")
        header[key] = words[1:]
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "DATA") if not header.get(key)]
    if missing:
        raise PointFileError(f"{source}: missing in the header: {', '.join(missing)}; write the file again")
    return header, data[position:]


def _demand_sensor_origin(header: dict[str, list[str]], source: str) -> None:
    """Raise PointFileError if the points are stated to be taken from another pose than the origin."""
    words = header.get("VIEWPOINT", [])
    try:
        pose = [float(word) for word in words]
    except ValueError:
        pose = []
    if not words or (len(pose) == 7 and max(abs(a - abs(b)) for a, b in zip(_IDENTITY, pose, strict=True)) < _SAME):
        return
    raise PointFileError(
        f"{source}: VIEWPOINT {' '.join(words)[:80]} states that the sensor was not at the origin of the points' axes; "
        f"subtract this pose from the points, or write VIEWPOINT 0 0 0 1 0 0 0 if they are relative to the sensor"
    )


def _whole(header: dict[str, list[str]], key: str, source: str) -> list[int]:
    values = header.get(key, [])
    if not all(word.isdecimal() and len(word) < 12 for word in values):
        raise PointFileError(f"{source}: {key} {' '.join(values)[:60]!r}; give whole numbers")
    return [int(word) for word in values]


def _kind(name: str, letter: str, size: int, source: str) -> str:
    kind = _KINDS.get(letter.upper(), "")
    if not kind or size not in ((4, 8) if kind == "f" else (1, 2, 4, 8)):
        raise PointFileError(f"{source}: field {name} has TYPE {letter} SIZE {size}; a number is F 4, F 8, U or I 1–8")
    return f"<{kind}{size}"


def _points(header: dict[str, list[str]], source: str) -> int:
    area = [_whole(header, key, source) for key in ("WIDTH", "HEIGHT")]
    cells = area[0][0] * (area[1] or [1])[0] if area[0] else None
    stated = _whole(header, "POINTS", source)
    if not stated and cells is None:
        raise PointFileError(f"{source}: neither POINTS nor WIDTH in the header; write the file again")
    if stated and cells is not None and stated[0] != cells:
        raise PointFileError(f"{source}: POINTS {stated[0]}, but WIDTH × HEIGHT is {cells}; correct the header")
    return stated[0] if stated else int(cells or 0)


def _text(
    body: bytes, names: list[str], types: list[str], counts: list[int], points: int, source: str
) -> dict[str, np.ndarray]:
    width = sum(counts)
    words = body.split()
    if len(words) < points * width:
        raise _short(source, len(words) // width if width else 0, points)
    try:
        table = np.array(words[: points * width], np.float64).reshape(points, width)
    except ValueError:
        bad = next(word for word in words if not _is_number(word))
        raise PointFileError(f"{source}: {bad.decode('ascii', 'replace')[:30]!r} is not a number") from None
    starts = np.cumsum([0, *counts])
    with np.errstate(invalid="ignore", over="ignore"):
        columns = [
            table[:, start : start + count].astype(kind)
            for start, count, kind in zip(starts[:-1], counts, types, strict=True)
        ]
    return _named(names, counts, columns)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _unpacked(body: bytes, types: list[str], counts: list[int], points: int, source: str) -> list[np.ndarray]:
    """Columns of a compressed file: all of one field after the other."""
    from cosim.point_files.libraries import needed

    if len(body) < 8:
        raise _short(source, 0, points)
    packed, unpacked = (int(value) for value in np.frombuffer(body, "<u4", 2))
    wanted = points * sum(np.dtype(kind).itemsize * count for kind, count in zip(types, counts, strict=True))
    if len(body) - 8 < packed:
        raise PointFileError(
            f"{source}: {len(body) - 8} of {packed} compressed bytes: the file is cut off; copy it again"
        )
    if unpacked != wanted:
        raise PointFileError(
            f"{source}: {unpacked} bytes of values, {points} points need {wanted}; write the file again"
        )
    try:
        data = needed("lzf", "a compressed PCD").decompress(body[8 : 8 + packed], unpacked) if unpacked else b""
    except ValueError as error:
        raise PointFileError(
            f"{source}: compressed values cannot be unpacked ({error}): damaged; copy it again"
        ) from None
    if data is None or len(data) != unpacked:
        raise PointFileError(f"{source}: compressed values unpack to another size: damaged; copy it again")
    columns, position = [], 0
    for kind, count in zip(types, counts, strict=True):
        size = np.dtype(kind).itemsize * count * points
        columns.append(np.frombuffer(data, kind, points * count, position).reshape(points, count))
        position += size
    return columns


def _named(names: list[str], counts: list[int], columns: list[np.ndarray]) -> dict[str, np.ndarray]:
    held = zip(names, counts, columns, strict=True)
    return {name: np.ascontiguousarray(values[:, 0]) for name, count, values in held if count == 1 and name != "_"}


def _short(source: str, held: int, points: int) -> PointFileError:
    return PointFileError(
        f"{source}: {held} points of {points} that its header says: the file is cut off; copy it again"
    )
