"""Reading whole files with errors that name them."""

from __future__ import annotations

from pathlib import Path

from cosim.errors import FormatError


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
