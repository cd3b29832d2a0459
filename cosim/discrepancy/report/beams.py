"""Residuals and covariates of the beams of validation frames for display, before and after the findings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.budget import ALIGNED, AlignedFrame, FramePairs
from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.scores import CLIP_M, FrameScores, Totals
from cosim.discrepancy.settings import Settings


@dataclass(frozen=True)
class PageLayout:
    """Numbers of charts and tables; they have no influence on findings."""

    bins: int = 20  # bins of a covariate
    names: int = 8  # most common categories in a chart
    fewest: int = 50  # minimum number of rows in a bin
    dots: int = 40  # maximum number of dots in a chart; more points are drawn as a line
    tie_share: float = 0.02  # charts whose sizes differ by less than this share of the largest keep their default order
    common: float = 0.02  # minimum share of rows of a bin that influences the scale of a chart
    excess: float = 0.05  # minimum share of the excess for a channel to be mentioned
    smallest_error: float = 5e-4  # smaller parts of an error are shown as 0.000
    values: int = 9  # maximum number of categories in the chart of an unknown dependence
    scans: int = 3  # number of scans shown as a whole
    beams: int = 60_000  # maximum number of beams of each, so that a page stays below 4 MB
    rows: int = 30_000  # maximum number of rows of each validation frame in charts
    sectors: int = 12  # azimuth sectors: clusters of beams that share errors after the pose is fitted
    largest_square: float = 25.0  # cap on squared standardised residuals
    cut_off: float = 3.0  # σ from a limit of intensity within which values may be censored


LAYOUT = PageLayout()


MATCHED, AMBIGUOUS, DROPPED, SPURIOUS, UNFORESEEN, SILENT = range(6)
_OF_SCANS = {
    "frame_time": ("time_s", "s"),
    "speed": ("speed_mps", "m/s"),
    "acceleration": ("acceleration_mps2", "m/s²"),
    "yaw_rate": ("yaw_rate_radps", "rad/s"),
}


@dataclass(frozen=True, eq=False)
class BeamColumn:
    """A covariate of n beams.

    Attributes:
        unit: unit of the values; empty for pure numbers and categories.
        values: (n,) float32 values, or numbers of categories; NaN if unknown.
        names: names of the categories by number; empty for numbers.
    """

    unit: str
    values: np.ndarray
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Rows:
    """Beams of all validation frames.

    Attributes:
        covariates: (n,) covariates by name.
        cluster: (n,) number of the frame's sector; beams of a sector share errors after the poses are fitted.
        before_cluster: (n,) cluster of the residuals before; the frame if these contain pose errors.
        frame: (n,) number of the frame.
        before, after: (n,) measured − predicted by channel; NaN if not compared. Ranges [m] are clipped at 1 m;
            intensities are omitted if another material may have been hit or if they may be censored; `drop` is the
            return (1 or 0) − its probability; `spurious` is 1 for a spurious return − its probability;
            `range_variance` and `intensity_variance` are squared residuals over stated variances − 1.
        settings: settings that the frames were traced with.
    """

    covariates: dict[str, BeamColumn]
    cluster: np.ndarray
    before_cluster: np.ndarray
    frame: np.ndarray
    before: dict[str, np.ndarray]
    after: dict[str, np.ndarray]
    settings: Settings


@dataclass(frozen=True, eq=False)
class Side:
    """One frame under one model.

    Attributes:
        error: error of the frame; NaN if nothing can be compared.
        state: (n,) uint8, one of MATCHED … SILENT.
        residuals: residuals of range, intensity and drop, as in `Rows`.
    """

    error: float
    state: np.ndarray
    residuals: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class ShownScan:
    """All beams of one frame.

    Attributes:
        name: name of the frame.
        rings, firings: layout of the scan; beams are ring-major.
        elevation_rad, azimuth_rad: (rings,) elevation of each ring and azimuth of its first firing.
        measured_m: (n,) measured range; NaN without a return.
        covariates: (n,) covariates as in `Rows`.
        before, after: the frame under both models.
    """

    name: str
    rings: int
    firings: int
    elevation_rad: np.ndarray
    azimuth_rad: np.ndarray
    measured_m: np.ndarray
    covariates: dict[str, BeamColumn]
    before: Side
    after: Side


@dataclass(frozen=True, eq=False)
class BeamResiduals:
    """Data of validation frames for a page.

    Attributes:
        rows: sampled beams for charts.
        scans: frames shown as a whole, the worst first.
        is_one: whether before and after are the same.
    """

    rows: Rows
    scans: tuple[ShownScan, ...]
    is_one: bool

    @classmethod
    def of(cls, frame_pairs: FramePairs, shown: int, names: Collection[str], seed: int = 0) -> BeamResiduals:
        """Collect the data of validation frames.

        Args:
            frame_pairs: frames before and after.
            shown: number of frames that are kept as a whole.
            names: names of the covariates that are used.
            seed: seed of the sampling of rows.
        """
        has_poses = "poses" not in frame_pairs.before_removed.parts
        parts: list[Rows] = []
        errors: list[float] = []
        for number, (before, after) in enumerate(frame_pairs.pairs()):
            parts.append(_rows(before, after, number, names, np.random.default_rng([seed, number]), has_poses))
            errors.append(Totals.of(before.frame, before.scores).error)
        scans = [_scan(before, after, names) for before, after in frame_pairs.pairs(_choose_scans(errors, shown))]
        scans.sort(key=lambda scan: -np.nan_to_num(scan.before.error))
        same = frame_pairs.before is frame_pairs.after and frame_pairs.before_removed == ALIGNED
        return cls(_concatenate(parts), tuple(scans), same)


def _choose_scans(errors: Sequence[float], count: int) -> list[int]:
    """Numbers of the worst frame and of other, evenly spaced frames; NaN errors count as 0."""
    worst = int(np.argmax(np.nan_to_num(np.array(errors))))
    spread = np.unique(np.linspace(0, len(errors) - 1, max(count, 1)).round().astype(int)).tolist()
    others = [number for number in spread if number != worst]
    return sorted([worst, *others[: count - 1]])


def residuals_of(aligned: AlignedFrame) -> dict[str, np.ndarray]:
    """Residuals (n,) of every channel, see `Rows`."""
    scores, expected, hits = aligned.scores, aligned.expected, aligned.frame.shot.hits
    clear = ~scores.ambiguous
    reach = LAYOUT.cut_off * expected.intensity_sigma  # residuals of censored values are biased
    inside = (expected.intensity - reach >= 0) & (expected.intensity + reach <= 1)
    has_intensity = scores.matched & np.isfinite(scores.intensity_score) & ~aligned.mixed & (inside | (reach <= 0))
    range_m = np.clip(scores.measured_m - expected.range_m, -CLIP_M, CLIP_M)
    intensity = scores.measured_intensity - expected.intensity
    returned = (~np.isnan(scores.measured_m)).astype(np.float32)
    residuals = {
        "range": np.where(scores.matched, range_m, np.nan),
        "intensity": np.where(has_intensity, intensity, np.nan),
        "drop": np.where(clear & hits.solid.exists, returned - (1 - expected.silent), np.nan),
        "spurious": np.where(clear, scores.spurious - scores.spurious_probability, np.nan),
        "range_variance": _excess(range_m, expected.range_sigma_m, scores.matched),
        "intensity_variance": _excess(intensity, expected.intensity_sigma, has_intensity),
    }
    return {name: values.astype(np.float32) for name, values in residuals.items()}


def _excess(residual: np.ndarray, sigma: np.ndarray, used: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        square = np.minimum((residual / sigma) ** 2, LAYOUT.largest_square) - 1
    return np.where(used & (sigma > 0), square, np.nan)


def columns_of(aligned: AlignedFrame, names: Collection[str], number: int = 0) -> dict[str, BeamColumn]:
    """Covariates (n,) of a frame's beams by name; `number` is the number of the frame."""
    count = len(aligned.sample)
    columns: dict[str, BeamColumn] = {}
    for covariate in sample_covariates(aligned.sample, aligned.prediction, (aligned.frame,), names):
        values = covariate.values.astype(np.float32)
        if covariate.labels and covariate.name != "ring":
            values = np.where(covariate.index >= 0, values, np.nan).astype(np.float32)
            labels = dict(zip(covariate.centres.astype(int).tolist(), covariate.labels, strict=True))
            words = tuple(labels.get(code, "") for code in range(max(labels) + 1))
            columns[covariate.name] = BeamColumn(covariate.unit, values, words)
        else:
            columns[covariate.name] = BeamColumn(covariate.unit, values)
    for name, (value, unit) in _OF_SCANS.items():
        columns[name] = BeamColumn(unit, np.full(count, aligned.sample.scan_values[value][0], np.float32))
    columns["scan"] = BeamColumn("", np.full(count, number, np.float32))
    return columns


def _rows(
    before: AlignedFrame,
    after: AlignedFrame,
    number: int,
    names: Collection[str],
    rng: np.random.Generator,
    has_poses: bool,
) -> Rows:
    count = len(after.sample)
    used = np.sort(rng.choice(count, min(count, LAYOUT.rows), replace=False))
    sector = np.floor((after.sample.azimuth[used] + np.pi) / (2 * np.pi) * LAYOUT.sectors).astype(int) % LAYOUT.sectors
    columns = columns_of(after, names, number)
    return Rows(
        covariates={
            name: BeamColumn(column.unit, column.values[used], column.names) for name, column in columns.items()
        },
        cluster=number * LAYOUT.sectors + sector,
        before_cluster=np.full(len(used), number) if has_poses else number * LAYOUT.sectors + sector,
        frame=np.full(len(used), number),
        before={name: values[used] for name, values in residuals_of(before).items()},
        after={name: values[used] for name, values in residuals_of(after).items()},
        settings=after.frame.settings,
    )


def _concatenate(parts: Sequence[Rows]) -> Rows:
    names = dict.fromkeys(name for rows in parts for name in rows.covariates)
    return Rows(
        covariates={name: _concatenate_column([rows.covariates.get(name) for rows in parts], parts) for name in names},
        cluster=np.concatenate([rows.cluster for rows in parts]),
        before_cluster=np.concatenate([rows.before_cluster for rows in parts]),
        frame=np.concatenate([rows.frame for rows in parts]),
        before={name: np.concatenate([rows.before[name] for rows in parts]) for name in parts[0].before},
        after={name: np.concatenate([rows.after[name] for rows in parts]) for name in parts[0].after},
        settings=parts[0].settings,
    )


def _concatenate_column(columns: Sequence[BeamColumn | None], parts: Sequence[Rows]) -> BeamColumn:
    """Concatenate a column over all frames; categories are numbered as in `joined_names`."""
    present = [column for column in columns if column is not None]
    words = joined_names(present)
    values = [
        np.full(len(rows.frame), np.nan, np.float32) if column is None else renumbered(column, words)
        for column, rows in zip(columns, parts, strict=True)
    ]
    return BeamColumn(present[0].unit, np.concatenate(values), words)


def joined_names(columns: Sequence[BeamColumn]) -> tuple[str, ...]:
    """Unique names of the categories of several columns; in the original order if it is the same in all."""
    longest = max(columns, key=lambda column: len(column.names)).names
    if all(not a or not b or a == b for column in columns for a, b in zip(column.names, longest, strict=False)):
        words = list(longest)
        for column in columns:
            for position, word in enumerate(column.names):
                words[position] = words[position] or word
        return tuple(words)
    return tuple(sorted({word for column in columns for word in column.names if word}))


def renumbered(column: BeamColumn, words: tuple[str, ...]) -> np.ndarray:
    """(n,) values of a column, with categories numbered by their position in `words`."""
    if not words:
        return column.values
    number = {word: position for position, word in enumerate(words)}
    places = np.array([number.get(word, np.nan) if word else np.nan for word in column.names] + [np.nan], np.float32)
    code = np.where(np.isfinite(column.values), column.values, len(column.names)).astype(int)
    return places[np.minimum(code, len(column.names))]


def _scan(before: AlignedFrame, after: AlignedFrame, names: Collection[str]) -> ShownScan:
    pattern, rays = after.frame.shot.pattern, after.frame.observed.rays
    first = np.arange(pattern.rings) * pattern.firings
    direction = rays.direction[first].astype(float)
    fan = np.radians(np.array(pattern.azimuth_offset_deg, float))
    return ShownScan(
        name=after.frame.name,
        rings=pattern.rings,
        firings=pattern.firings,
        elevation_rad=np.arcsin(np.clip(direction[:, 2], -1, 1)),
        azimuth_rad=np.pi - np.pi / pattern.firings + fan,
        measured_m=after.scores.measured_m,
        covariates=columns_of(after, names),
        before=_side(before),
        after=_side(after),
    )


def _side(aligned: AlignedFrame) -> Side:
    residuals = residuals_of(aligned)
    shown = {name: residuals[name] for name in ("range", "intensity", "drop")}
    return Side(Totals.of(aligned.frame, aligned.scores).error, state_of(aligned.scores), shown)


def state_of(scores: FrameScores) -> np.ndarray:
    """State (n,) uint8 of each beam, one of MATCHED … SILENT."""
    returned = ~np.isnan(scores.measured_m)
    state = np.full(len(returned), SILENT, np.uint8)
    state[returned] = UNFORESEEN
    state[~returned & (scores.expected > 0.5)] = DROPPED
    state[scores.matched] = MATCHED
    state[scores.spurious] = SPURIOUS
    state[scores.ambiguous & (returned | (scores.expected > 0))] = AMBIGUOUS
    return state
