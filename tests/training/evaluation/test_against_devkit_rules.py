"""The vectorised evaluation gives what the devkit's loops give."""

from __future__ import annotations

import numpy as np
import pytest

from tests.training.evaluation.devkit_rules import average_precisions
from tests.training.evaluation.scenes import as_detections, objects
from training.evaluation import evaluate, pair_frames


@pytest.mark.parametrize(("seed", "spread", "ties"), [(0, 0.03, False), (1, 0.08, True), (2, 0.02, True)])
def test_random_detections_score_as_with_the_devkits_loops(seed, spread, ties):
    rng = np.random.default_rng(seed)
    labels = [objects(rng, int(rng.integers(0, 14))) for _ in range(16)]
    detections = [as_detections(rng, found, spread, ties) for found in labels]
    frames = list(zip(labels, detections, strict=True))
    results = evaluate(pair_frames(labels, detections)).results
    for name, metrics in results.items():
        for metric, levels in metrics.items():
            for level, result in enumerate(levels):
                expected = average_precisions(name.lower(), metric, level, frames)
                own = [result.r40, result.r11] + ([result.aos40, result.aos11] if metric == "2d" else [])
                assert own == pytest.approx(expected[: len(own)], abs=1e-6), (name, metric, level)
