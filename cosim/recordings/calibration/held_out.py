"""Scores of sensor models on held-out scans, beam by beam, so that two models are compared on the same beams.

Maps of points with different effects undone hold different surfaces, so that errors over all beams of each are not
comparable: a map that loses its difficult places makes the error fall.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.budget import Aligned
from cosim.discrepancy.scores import SCALES
from cosim.drives.files import read_bytes
from cosim.drives.writer import explained
from sensors.npz import npz_arrays, npz_bytes

_CHANNELS = {"range": "range_score", "intensity": "intensity_score", "drop": "brier"}
LEAST_FALL = 1e-3  # share of the error; a smaller fall is of no use, even if it is certain
_UPPER = 0.975
_FEWEST_BEAMS, _FEWEST_SCANS = 100, 3
_SAME_STRETCH = 6  # scans: nearer ones see the same surfaces, so that their errors are dependent

Scores = Mapping[str, Mapping[str, np.ndarray]]
"""By scan and channel, (n,) scores of the beams of the pattern; NaN where a beam was not compared."""


@dataclass(frozen=True)
class Change:
    """The change of the aligned error of held-out scans from one model to another, on beams that both compare.

    Attributes:
        before, after: means over the scans.
        mean: of the changes of single scans.
        low, high: 95 % interval of the mean.
        scans, beams: how many were compared.
    """

    before: float
    after: float
    mean: float
    low: float
    high: float
    scans: int
    beams: int

    @property
    def is_fall(self) -> bool:
        """Whether the interval excludes that nothing changes or the error rises, and the fall matters."""
        return self.high < 0 and self.mean < -LEAST_FALL * self.before

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def aligned_scores(aligned: Aligned) -> Scores:
    """Scores of frames with poses, objects and map aligned."""
    names, found = aligned.names, aligned.scores()
    return {
        name: {channel: getattr(scores, field).astype(np.float32) for channel, field in _CHANNELS.items()}
        for name, scores in zip(names, found, strict=True)
    }


def write_scores(file: Path, models: Mapping[str, Scores]) -> None:
    """Keep the scores of several models, by name.

    Raises:
        OutputError: the file cannot be written.
    """
    arrays = {
        f"{model}/{name}/{channel}": values
        for model, scans in models.items()
        for name, channels in scans.items()
        for channel, values in channels.items()
    }
    with explained(file):
        file.write_bytes(npz_bytes(arrays))


def read_scores(file: Path) -> dict[str, Scores]:
    """Read the scores that `write_scores` wrote."""
    scores: dict[str, dict[str, dict[str, np.ndarray]]] = {}
    for key, values in npz_arrays(read_bytes(file)).items():
        model, name, channel = key.split("/")
        scores.setdefault(model, {}).setdefault(name, {})[channel] = values
    return dict(scores)


def change_between(before: Scores, after: Scores) -> Change | None:
    """Change of the error; None if fewer than three scans can be compared.

    The interval is Student's over scans, or over stretches of neighbouring scans where that is wider.
    """
    rows, names, beams = [], [], 0
    for name in before:
        pair = _errors(before[name], after[name]) if name in after else None
        if pair is not None:
            rows.append(pair[:2])
            names.append(int(name))
            beams += pair[2]
    if len(rows) < _FEWEST_SCANS:
        return None
    first, last = np.array(rows).T
    change = last - first
    half = float(stats.t.ppf(_UPPER, len(change) - 1)) * _standard_error(change, np.array(names))
    mean = float(change.mean())
    return Change(float(first.mean()), float(last.mean()), mean, mean - half, mean + half, len(change), beams)


def _errors(before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray]) -> tuple[float, float, int] | None:
    """Errors of one scan under two models on common beams, and how many; None where these are too few."""
    pairs, beams = [], 0
    for channel, scale in SCALES.items():
        if channel not in before or channel not in after:
            continue
        both = np.isfinite(before[channel]) & np.isfinite(after[channel])
        if both.sum() >= _FEWEST_BEAMS:
            pairs.append([float(values[channel][both].mean(dtype=float)) / scale for values in (before, after)])
            beams = max(beams, int(both.sum()))
    if not pairs:
        return None
    first, last = np.mean(pairs, axis=0)
    return float(first), float(last), beams


def _standard_error(change: np.ndarray, number: np.ndarray) -> float:
    """Standard error of the mean of changes (n,) of scans with these numbers: over scans or stretches, the larger."""
    count, off = len(change), change - change.mean()
    single = np.sqrt(off @ off / (count * (count - 1)))
    stretch = np.cumsum(np.diff(number, prepend=number[0]) > _SAME_STRETCH)
    stretches = int(stretch[-1]) + 1
    if stretches < 2:
        return float(single)
    sums = np.bincount(stretch, off)
    return float(max(single, np.sqrt(sums @ sums * stretches / (stretches - 1)) / count))
