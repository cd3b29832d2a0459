"""Layout of rows of numbers without a header: number of columns, byte order, size of a number.

The values of a table repeat their kind with the period of the number of columns: coordinates, intensities and times
differ in distribution, and neighbouring points are near each other. The rank correlation between a value and the one
`w` places behind it is therefore greatest for the true number of columns `w` (or a multiple of it), whatever the units,
outliers and order of the points are. Byte order and size are those in which the values have ordinary magnitudes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.point_files.scan import PointFileError, UnequalRowsError

WIDTHS = (4, 5, 6, 3, 7, 8, 9, 10, 12)  # columns, the most likely first
_KINDS = ("<f4", ">f4", "<f8")
_VALUES = 48_000  # of a file that are looked at
_ORDINARY = (1e-6, 1e7)  # magnitudes of coordinates, intensities, times; zero is ordinary too
_ORDINARY_SHARE = 0.9
_MOST_SHARE, _LEAD = 0.6, 0.15  # a smaller share that leads that of other kinds of number by so much
_TEXT_BYTES, _PRINTABLE = 512, frozenset(range(32, 127)) | {9, 10, 13}
_LFS = b"version https://git-lfs"
_FEWEST_ROWS = 50  # for a correlation that means something
_CLEAR = 0.25  # least correlation of a true period
_CONTRADICTS = 0.2  # correlation by which another period of a scan beats that of all scans
_TIE = 0.03  # periods whose correlations differ by less are multiples of each other


@dataclass(frozen=True)
class RowLayout:
    """Rows of numbers without a header.

    Attributes:
        columns: numbers a row.
        kind: numpy's name of one number, with its byte order.
        correlation: rank correlation at this period; 0 where there were too few points to say.
    """

    columns: int = 4
    kind: str = "<f4"
    correlation: float = 0.0

    @property
    def row_bytes(self) -> int:
        """Size of one row."""
        return self.columns * np.dtype(self.kind).itemsize

    def rows(self, data: bytes, source: str) -> np.ndarray:
        """(n, columns) values in native byte order.

        Raises:
            PointFileError: the file ends within a row.
        """
        spare = len(data) % self.row_bytes
        if spare:
            size = np.dtype(self.kind).itemsize
            others = [width for width in sorted(WIDTHS) if not len(data) % (width * size)]
            remedy = f", or say `columns: {others[0]}` in drive.yaml (--columns)" if others else ""
            raise PointFileError(
                f"{source}: {len(data)} bytes are not a multiple of {self.row_bytes} ({self.columns} columns of "
                f"{np.dtype(self.kind).name}): {spare} bytes behind the last whole row, so the file is cut off "
                f"(truncated) or "
                f"has another number of columns: copy it again, choose the scans with --scans{remedy}"
            )
        stored = np.frombuffer(data, self.kind).reshape(-1, self.columns)
        return stored.astype(stored.dtype.newbyteorder("="), copy=False)


def find_row_layout(samples: Sequence[bytes], source: str, columns: int | None = None) -> RowLayout:
    """The layout that all clues agree on.

    Args:
        samples: content of some files of one sensor.
        source: name of folder or file, for messages.
        columns: number of columns, where the user states it.

    Raises:
        PointFileError: no number of columns divides the files, or their values are no such rows.
    """
    filled = [data for data in samples if data]
    if not filled:
        return RowLayout(columns or 4)
    kind = _find_kind(filled, source)
    widths = (columns,) if columns else WIDTHS
    least = 1 if columns else len(filled) // 2 + 1
    fitting = [width for width in widths if _dividing(filled, width, kind) >= least]
    if not fitting:
        sizes = ", ".join(str(size) for size in sorted({len(data) for data in filled})[:3])
        known = " or ".join(str(width) for width in sorted(widths))
        raise PointFileError(
            f"{source}: {sizes} bytes are no rows of {known} {np.dtype(kind).name}, not a multiple of 12 or "
            f"{4 * (columns or 4)}: the file is cut off (truncated) or no scan: copy it again, or choose the scans "
            "with --scans"
        )
    found = {width: _correlation(filled, width, kind) for width in fitting}
    best = max(found.values())
    if columns is None:
        _demand_one_width(filled, max(found, key=lambda width: found[width]), kind, source)
    if best < _CLEAR:
        likeliest = _plausible(filled, fitting, kind)
        return RowLayout(likeliest, kind, 0.0)
    width = min(width for width, value in found.items() if value > best - _TIE)
    return RowLayout(width, kind, round(best, 3))


def _demand_one_width(samples: Sequence[bytes], width: int, kind: str, source: str) -> None:
    """Raise UnequalRowsError if scans clearly have rows of another number of columns than most."""
    others: dict[int, int] = {}
    for data in samples:
        own = {each: _correlation([data], each, kind) for each in WIDTHS if _dividing([data], each, kind)}
        best = max(own.values(), default=0.0)
        if best > max(_CLEAR, own.get(width, 0.0) + _CONTRADICTS):
            likeliest = min(each for each, value in own.items() if value > best - _TIE)
            if not width % likeliest or not likeliest % width:
                continue  # a multiple of the period
            others[likeliest] = others.get(likeliest, 0) + 1
    if others:
        report = ", ".join(f"{count} with {each} columns" for each, count in sorted(others.items()))
        remaining = len(samples) - sum(others.values())
        rest = f", {remaining} with {width} columns" if remaining else ""
        raise UnequalRowsError(
            f"{source}: scans of one sensor have rows of one length, but of {len(samples)} scans that were compared, "
            f"{report}{rest}; choose those of one kind with --scans, or state the number with --columns (`columns:` in "
            f"drive.yaml)"
        )


def _find_kind(samples: Sequence[bytes], source: str) -> str:
    """The kind of number as which nearly all values are ordinary, or clearly more than as any other.

    One column of other magnitudes, as of stamps since 1970 in ns, leaves the rest ordinary.
    """
    _refuse_text(samples, source)
    shares = {kind: _ordinary_share(samples, kind) for kind in _KINDS}
    for kind, share in shares.items():
        others = max(value for other, value in shares.items() if other != kind)
        if share >= _ORDINARY_SHARE or (share >= _MOST_SHARE and share > others + _LEAD):
            return kind
    report = ", ".join(f"{np.dtype(kind).name} {kind[0]}: {share:.0%}" for kind, share in shares.items())
    raise PointFileError(
        f"{source}: values have no ordinary magnitudes (1e-6 to 1e7) as rows of numbers ({report}), so this is no "
        "scan of x y z …: write it as .npz with named arrays, or choose the scans with --scans"
    )


def _refuse_text(samples: Sequence[bytes], source: str) -> None:
    """Raise PointFileError if the files are text."""
    for data in samples:
        head = data[:_TEXT_BYTES]
        if sum(byte in _PRINTABLE for byte in head) < len(head):
            continue
        start = head[:40].decode("ascii").split("\n")[0]
        if head.startswith(_LFS):
            remedy = "it is a pointer of Git LFS: fetch the file itself with `git lfs pull`"
        else:
            remedy = (
                f"it is text ({start!r}), not rows of numbers: fetch the scan again, or choose the scans with --scans"
            )
        raise PointFileError(f"{source}: {remedy}")


def _ordinary_share(samples: Sequence[bytes], kind: str) -> float:
    """Share of values of ordinary magnitude; those that are not finite are not counted."""
    size = np.dtype(kind).itemsize
    values = np.concatenate([np.frombuffer(data[: len(data) // size * size], kind)[:_VALUES] for data in samples])
    values = np.abs(values[np.isfinite(values)].astype(np.float64))
    if not len(values):
        return 1.0 if kind == _KINDS[0] else 0.0
    return float(np.mean((values == 0) | ((values > _ORDINARY[0]) & (values < _ORDINARY[1]))))


def _dividing(samples: Sequence[bytes], width: int, kind: str) -> int:
    return sum(len(data) % (width * np.dtype(kind).itemsize) == 0 for data in samples)


def _correlation(samples: Sequence[bytes], width: int, kind: str) -> float:
    """Mean rank correlation of values and of magnitudes between rows that follow each other."""
    found = []
    for data in samples:
        size = np.dtype(kind).itemsize
        values = np.frombuffer(data[: len(data) // size * size], kind)[:_VALUES].astype(np.float64)
        if len(values) < width * _FEWEST_ROWS:
            continue
        for ranks in (_ranks(values), _ranks(np.abs(values))):
            before, after = ranks[:-width], ranks[width:]
            both = np.isfinite(before) & np.isfinite(after)
            spread = float(np.nanmean(ranks**2)) if both.any() else 0.0
            if spread > 0:
                found.append(float((before[both] * after[both]).mean()) / spread)
    return float(np.mean(found)) if found else 0.0


def _ranks(values: np.ndarray) -> np.ndarray:
    """Mean ranks about 0, in −0.5 … 0.5; NaN where a value is not finite."""
    ranks = np.full(len(values), np.nan)
    finite = np.isfinite(values)
    if finite.any():
        _, index, count = np.unique(values[finite], return_inverse=True, return_counts=True)
        ranks[finite] = ((np.cumsum(count) - (count + 1) / 2) / finite.sum())[index] - 0.5 + 0.5 / finite.sum()
    return ranks


def _plausible(samples: Sequence[bytes], fitting: Sequence[int], kind: str) -> int:
    """The most likely width whose columns after x y z are not negative, for files of few points."""
    for width in fitting:
        size = width * np.dtype(kind).itemsize
        whole = [np.frombuffer(data[: len(data) // size * size], kind).reshape(-1, width) for data in samples]
        rest = np.concatenate([rows[:, 3:] for rows in whole])
        if not (rest < 0).any():
            return width
    return fitting[0]
