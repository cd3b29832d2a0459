"""Reading whole files with errors that name them, and names from files that end up in paths."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import Any

from assets.documents import DocumentError, parse_yaml
from cosim.errors import FormatError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*", re.ASCII)


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        FormatError: it is missing or unreadable.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from None


def read_text(path: str | Path) -> str:
    """The text of a UTF-8 file.

    Raises:
        FormatError: it is missing, unreadable or not UTF-8.
    """
    try:
        return read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: not a text file (byte {error.start} is not UTF-8)") from None


def read_mapping(path: str | Path) -> dict[str, Any]:
    """The keys and values of a YAML file; none of an empty one.

    Raises:
        FormatError: it is missing, unreadable, not YAML, or holds something else.
    """
    try:
        content = parse_yaml(read_text(path))
    except DocumentError as error:
        raise FormatError(f"{path}: not readable as YAML ({error})") from None
    if content is not None and not isinstance(content, dict):
        raise FormatError(f"{path}: holds {type(content).__name__}, not keys with values")
    return content or {}


def numbers(words: list[str], where: str) -> list[float]:
    """Words of a text file as finite floats.

    Raises:
        FormatError: a word is not a number, or not finite; `where` leads the message.
    """
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            raise FormatError(f"{where}: {word!r} is not a number") from None
        if not abs(value) < float("inf"):
            raise FormatError(f"{where}: {word!r} is not finite")
        values.append(value)
    return values


def is_safe_name(name: str) -> bool:
    """Whether a name can be one part of a path: letters, digits, `_ . + -`, not leading with `.` or `-`."""
    return bool(_NAME.fullmatch(name)) and len(name) <= 200


def is_safe_path(path: str) -> bool:
    """Whether a path with `/` stays inside the folder it is relative to."""
    return bool(path) and not path.startswith("/") and all(map(is_safe_name, PurePosixPath(path).parts))
