"""Synthetic scores as a linearisation of the diagnosis core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import sparse

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, LinearisedChannel
from cosim.discrepancy.inference.clusters import Clusters
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score import Evidence, Factored
from cosim.discrepancy.settings import DEFAULT, Settings
from tests.hidden.statistics.score_tables import COUNTS, Beams, Scores, SparseMatrix

PRECISION = 1 / 0.15**2


@dataclass(frozen=True, eq=False)
class _Sample:
    """What the core reads of a sample."""

    azimuth: np.ndarray
    frame: np.ndarray
    firing: np.ndarray
    ring: np.ndarray
    block: np.ndarray
    track: np.ndarray
    share: np.ndarray
    clear: np.ndarray
    first: np.ndarray
    settings: Settings = DEFAULT
    of_own_map: bool = False

    def __len__(self) -> int:
        return len(self.azimuth)


def linearised(
    beams: Beams,
    scores: Mapping[str, Scores],
    random_columns: Mapping[str, SparseMatrix] | None = None,
    estimate: np.ndarray | None = None,
) -> Linearisation:
    """A linearisation of synthetic scores.

    Args:
        beams: the n beams.
        scores: by channel.
        random_columns: by channel, the (n, tracks) columns of one random effect per track.
        estimate: (tracks,) fitted random effects that the scores are about; by default scores are about no random
            effects, and these are fitted here.
    """
    n, tracks = len(beams), int(beams.track.max()) + 1
    ones, zero = np.ones(n), np.zeros(n, int)
    sample = _Sample(
        beams.azimuth,
        beams.scan,
        beams.firing,
        zero,
        zero,
        beams.track,
        beams.share,
        np.ones(n, bool),
        np.ones(n, bool),
    )
    evidence = Evidence(
        {name: of.score for name, of in scores.items()},  # type: ignore[arg-type]
        {name: of.information for name, of in scores.items()},  # type: ignore[arg-type]
    )
    z: dict[Any, Any] = dict(random_columns or {})
    used = np.arange(tracks if z else 0)
    known = sparse.csr_matrix((len(used), len(used)))
    for name, matrix in z.items():
        known = known + matrix.T @ sparse.diags(scores[name].information) @ matrix
    precision = np.full(len(used), PRECISION)
    solver = Factored(sparse.csr_matrix(known + sparse.diags(precision)), np.arange(len(used))) if z else None
    u = np.zeros(tracks) if estimate is None else estimate
    if estimate is None and solver is not None:
        u = solver.solve(sum(matrix.T @ scores[name].score for name, matrix in z.items()))
        for name, matrix in z.items():
            evidence.score[name] = scores[name].score - scores[name].information * (matrix @ u)  # type: ignore[index]
    mixed = LinearModel({}, z, used, precision, known, np.zeros(len(used), int), solver, evidence)

    def clusters_of(positions: bool, sectors: int) -> Clusters:
        sector = np.minimum(((beams.azimuth + np.pi) / (2 * np.pi) * sectors).astype(int), sectors - 1)
        part = beams.scan * sectors + sector
        return Clusters(beams.track, beams.scan, part, np.arange(tracks), np.full(tracks, -1))

    random = SimpleNamespace(clusters_of=clusters_of, has_poses=True)
    fitter: Any = SimpleNamespace(sample=sample, random=random)
    prediction = SimpleNamespace(seen=np.full(n, 0.93), silent=np.full(n, 0.07))
    fitted: Any = SimpleNamespace(
        estimate=SimpleNamespace(u=u, variance=np.array([1 / PRECISION])),
        prediction=prediction,
        columns=(),
        dependences=(),
    )
    channels = {name: LinearisedChannel(name, name, ones, one_sided=name in COUNTS) for name in scores}  # type: ignore[arg-type]
    return Linearisation(fitter, fitted, (), fitted.prediction, evidence, channels, mixed)


def group_of(channel: str, name: str, basis: SparseMatrix) -> Group:
    """The hypothesis that a channel depends on the bins of a covariate."""
    return Group(
        f"{channel} by {name}",
        channel,
        (name,),
        basis.shape[1],
        {channel: basis},  # type: ignore[dict-item]
        basis,
        one_sided=channel in COUNTS,
        is_count=channel in COUNTS,
    )
