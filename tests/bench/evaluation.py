"""How long KITTI's scoring takes on as many frames as its validation half has: `python -m tests.bench.evaluation`."""

from __future__ import annotations

import time

import numpy as np

from tests.training.evaluation.scenes import as_detections, objects
from training.evaluation import evaluate, pair_frames

_FRAMES = 3769


def main() -> None:
    rng = np.random.default_rng(0)
    labels = [objects(rng, int(rng.integers(4, 14))) for _ in range(_FRAMES)]
    scored = pair_frames(labels, [as_detections(rng, subset, 0.05, ties=False) for subset in labels])
    wall, processor = time.perf_counter(), time.process_time()
    evaluate(scored)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    counts = f"{len(scored.labels.kind):,} labels, {len(scored.detections.kind):,} detections"
    print(f"{_FRAMES:,} frames, {counts}: {wall:.1f} s, {processor:.1f} s of processor time")


if __name__ == "__main__":
    main()
