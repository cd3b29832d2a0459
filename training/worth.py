"""Ablation of the effects of a sensor model with a detector; see `cosim.variants.worth`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive, Labels
from cosim.variants.rescans import rescans, without
from cosim.variants.worth import EffectWorth, Worth
from sensors.sensor_model import SensorModel
from training.data.views import Rescanned
from training.errors import TrainingError
from training.evaluation import Result, evaluate, pair_frames
from training.evaluation.bootstrap import interval, resample
from training.evaluation.evaluate import tasks
from training.evaluation.rules import MIN_OVERLAP, SAMPLES
from training.weights import shipped

_LEVEL, _METRIC = 1, "3d"
_DRAWS = 1000


def value_effects(
    drive: Drive,
    names: Sequence[str],
    sensor: SensorModel,
    effects: Sequence[str],
    checkpoint: Path,
    *,
    given: SensorModel | None = None,
    seed: int = 0,
    on_frame: Callable[[], None] = lambda: None,
) -> Worth:
    """Score a detector on scans simulated with a whole sensor model, and with each effect removed in turn.

    Args:
        drive: drive with labels and a twin.
        names: frames to use.
        sensor: the whole model.
        effects: names of the effects to remove, one at a time.
        checkpoint: checkpoint of the detector; its first class is scored, 3D at moderate.
        given: baseline, the model before diagnosis; a removed effect reverts to its parameters there, if it has any.
        seed: random seed of the bootstrap.
        on_frame: called after each frame.

    Raises:
        TrainingError: a frame has no labels, or none of them counts.
        CosimError: the twin cannot be traced.
    """
    from training.checkpoints import load_detector
    from training.devices import find_device
    from training.predict import predict

    unlabelled = [name for name in names if not drive[name].has("label_2")]
    if unlabelled:
        raise TrainingError(
            f"{drive.root}: frame {unlabelled[0]} has no label_2/, so no detector can be scored; omit --detector, "
            "or choose labelled --frames"
        )
    device = find_device("auto")
    detector, classes = load_detector(checkpoint)
    detector.to(device)
    sensors = [sensor, *(without(sensor, effect, given) for effect in effects)]
    detections: list[list[Labels]] = [[] for _ in range(1 + len(sensors))]
    for frame, scans in rescans(drive, names, sensors):
        rescanned = [frame, *(Rescanned.of(frame, scan) for scan in scans)]
        for collected, labels in zip(detections, predict(detector, rescanned, classes, device), strict=True):
            collected.append(labels)
        on_frame()
    labels = [drive[name].labels for name in names]
    results = [_evaluate_class(labels, detected, names, classes[0]) for detected in detections]
    objects = _count_objects(labels, names, classes[0])
    if not objects:
        raise TrainingError(
            f"{drive.root}: no {classes[0]} of its {len(names)} frames counts at moderate; choose other --frames"
        )
    is_small = objects < SAMPLES  # R40 cannot reach 100 then
    draws = [_bootstrap(result, seed)[:, int(is_small)] for result in results]
    averages = [0.0 if result is None else result.continuous if is_small else result.r40 for result in results]
    (measured, model, *others), (measured_draws, model_draws, *other_draws) = averages, draws
    return Worth(
        detector="pillars_small, bundled" if checkpoint == shipped() else str(checkpoint),
        scored=f"3D AP{' (whole curve)' if is_small else ' R40'} of {classes[0]} at moderate",
        frames=len(names),
        objects=objects,
        measured=measured,
        model=model,
        gap=model - measured,
        gap_ci95=interval(model_draws - measured_draws),
        effects=tuple(
            EffectWorth(effect, ap, ap - model, interval(effect_draws - model_draws))
            for effect, ap, effect_draws in zip(effects, others, other_draws, strict=True)
        ),
    )


def _evaluate_class(
    labels: Sequence[Labels], detections: Sequence[Labels], names: Sequence[str], name: str
) -> Result | None:
    """Result of the class at moderate; None without detections."""
    results = evaluate(pair_frames(labels, detections, names), classes=(name,)).results.get(name)
    return results[_METRIC][_LEVEL] if results and _METRIC in results else None


def _count_objects(labels: Sequence[Labels], names: Sequence[str], name: str) -> int:
    """Number of objects that count."""
    empty = [Labels.empty() for _ in labels]
    (_, task, _) = tasks(pair_frames(labels, empty, names), name, _METRIC, MIN_OVERLAP[name])
    return int(task.object_counts.sum())


def _bootstrap(result: Result | None, seed: int) -> np.ndarray:
    """Bootstrap draws of R40 and of AP of the whole curve; equal seeds draw equal frames, so draws are paired."""
    return np.zeros((_DRAWS, 2)) if result is None else resample(result, np.random.default_rng(seed), _DRAWS)
