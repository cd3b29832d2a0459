"""Ways to spoil a file: its bytes, its words, or the members of an archive whose checksums then still hold."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable

import numpy as np

Mutation = Callable[[bytes, np.random.Generator], bytes]

_NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "1e308", "-1e308", "1e-320", "99999999999999999999", "2147483648", "-0.0", "1_0",
    "0x10", "true", "null", "~", "[]", "{}", '""', "'", '"', "\x00", "é", "../../etc/passwd", "/etc/passwd", "C:\\x",
    "&a [*a]", "!!python/object/apply:os.system [x]", "<!ENTITY a 'b'>", "&a;", "%s%n", "9" * 400, "[" * 200, "{" * 200,
)  # fmt: skip
_BYTES = (b"\x00" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80", b"\x01\x00\x00\x00", b"\x00\x00\xc0\x7f")


def spoil_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """A few random changes of bytes."""
    for _ in range(int(rng.integers(1, 4))):
        data = _BYTE_CHANGES[rng.integers(len(_BYTE_CHANGES))](bytearray(data), rng)
    return data


def spoil_text(data: bytes, rng: np.random.Generator) -> bytes:
    """A few random changes of words and lines; now and then of bytes."""
    if rng.random() < 0.2:
        return spoil_bytes(data, rng)
    for _ in range(int(rng.integers(1, 4))):
        data = _TEXT_CHANGES[rng.integers(len(_TEXT_CHANGES))](data, rng)
    return data


def spoil_zip(data: bytes, rng: np.random.Generator) -> bytes:
    """A change within a member of an archive, or of the members' names; now and then of the archive's bytes."""
    if rng.random() < 0.25:
        return spoil_bytes(data, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = list(members)[rng.integers(len(members))]
    match rng.integers(4):
        case 0:
            del members[name]
        case 1:
            members[name] = members[list(members)[rng.integers(len(members))]]
        case 2:
            head = members[name].find(b"\n") + 1
            members[name] = spoil_text(members[name][:head], rng) + members[name][head:]
        case _:
            members[name] = spoil_bytes(members[name], rng)
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, content in members.items():
            archive.writestr(key, content)
    return target.getvalue()


def spoil_glb(data: bytes, rng: np.random.Generator) -> bytes:
    """A change of the JSON of a binary glTF with lengths that still agree; now and then of its bytes."""
    if rng.random() < 0.3:
        return spoil_bytes(data, rng)
    length = struct.unpack_from("<I", data, 12)[0]
    text, rest = data[20 : 20 + length], data[20 + length :]
    text = spoil_json(text, rng)
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def spoil_json(data: bytes, rng: np.random.Generator) -> bytes:
    """A value somewhere in a JSON document replaced or removed; now and then its words."""
    if rng.random() < 0.3:
        return spoil_text(data, rng)
    document = json.loads(data)
    node, key = _somewhere(document, rng)
    if node is not None:
        if rng.random() < 0.3:
            del node[key]
        else:
            node[key] = _VALUES[rng.integers(len(_VALUES))]
    return json.dumps(document).encode()


_VALUES = (
    None,
    True,
    -1,
    0,
    1e308,
    2**63,
    10**30,
    "",
    "x" * 3000,
    "../x",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    float("nan"),
)


def _somewhere(node: object, rng: np.random.Generator) -> tuple:
    """A random place in a document, as its container and key."""
    found: tuple = (None, None)
    while isinstance(node, dict | list) and node:
        keys = list(node) if isinstance(node, dict) else range(len(node))
        found = (node, keys[rng.integers(len(keys))])
        node = found[0][found[1]]
        if rng.random() < 0.2:
            break
    return found


def _flip(data: bytearray, rng: np.random.Generator) -> bytes:
    for _ in range(int(rng.integers(1, 9))):
        if data:
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return bytes(data)


def _cut(data: bytearray, rng: np.random.Generator) -> bytes:
    return bytes(data[: rng.integers(len(data) + 1)])


def _drop(data: bytearray, rng: np.random.Generator) -> bytes:
    start, end = sorted(rng.integers(0, len(data) + 1, 2))
    return bytes(data[:start] + data[end:]) if rng.random() < 0.5 else bytes(data[:start] + data[start + 1 :])


def _repeat(data: bytearray, rng: np.random.Generator) -> bytes:
    start, end = sorted(rng.integers(0, len(data) + 1, 2))
    return bytes(data[:end] + data[start:end] + data[end:])


def _insert(data: bytearray, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return bytes(data[:at]) + rng.bytes(int(rng.integers(1, 20))) + bytes(data[at:])


def _overwrite(data: bytearray, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(max(len(data) - 3, 1)))
    data[at : at + 4] = _BYTES[rng.integers(len(_BYTES))]
    return bytes(data)


_BYTE_CHANGES = (_flip, _cut, _drop, _repeat, _insert, _overwrite)


def _word(data: bytes, rng: np.random.Generator) -> bytes:
    """A word replaced by a trap, or by another word of the text."""
    words = data.replace(b",", b" , ").replace(b":", b" : ").split()
    if not words:
        return data
    old = words[rng.integers(len(words))]
    other = rng.random() < 0.3
    new = words[rng.integers(len(words))] if other else _NUMBERS[rng.integers(len(_NUMBERS))].encode()
    at = data.find(old, int(rng.integers(len(data))))
    at = data.find(old) if at < 0 else at
    return data[:at] + new + data[at + len(old) :]


def _line(data: bytes, rng: np.random.Generator) -> bytes:
    """A line removed, doubled, or put elsewhere."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    row = int(rng.integers(len(lines)))
    line = lines[row] if rng.random() < 0.5 else lines.pop(row)
    if rng.random() < 0.7:
        lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"".join(lines)


_TEXT_CHANGES = (_word, _word, _word, _line)
