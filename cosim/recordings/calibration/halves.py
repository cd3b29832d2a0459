"""Beam directions from two halves of a recording, each fitted by itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cosim.discrepancy.analysis import context_of, trace_and_fit
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.settings import Settings
from cosim.recordings.calibration.directions import DirectionError, direction_error
from cosim.recordings.pattern.find import find_pattern
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError
from sensors.effects.base import Effect
from sensors.sensor_model import SensorModel

_FEWEST = 4  # scans of a half
_LOOKED = 6  # scans of a half that its pattern is found in


def direction_error_of_halves(
    recording: Recording,
    twin: Path,
    sensor: SensorModel,
    frames: Sequence[str],
    free: Sequence[str],
    settings: Settings,
) -> DirectionError | None:
    """Angles between the true beams that the scans of two halves give; None where there are too few scans.

    Args:
        recording: scans in order.
        twin: drive of the recording.
        sensor: model to fit again.
        frames: of the twin that are fitted, in order.
        free: names of the effects that are fitted again.
        settings: of the fits.

    Raises:
        RecordingError: a scan is damaged.
    """
    middle = len(frames) // 2
    if middle < _FEWEST:
        return None
    try:
        first, second = (find_pattern(part, "half", _LOOKED).pattern for part in _parts(recording))
    except RecordingError:  # a half shows no pattern of its own
        return None
    effects = [
        _fitted(twin, sensor, part, free, settings) if free else sensor.effects
        for part in (frames[:middle], frames[middle:])
    ]
    return direction_error(first, second, *effects)


def _parts(recording: Recording) -> tuple[Recording, Recording]:
    middle = len(recording) // 2
    return recording.between(0, middle), recording.between(middle, len(recording))


def _fitted(
    twin: Path, sensor: SensorModel, frames: Sequence[str], free: Sequence[str], settings: Settings
) -> Sequence[Effect]:
    """The effects of a sensor, some of them fitted to some frames."""
    context = context_of(opened(twin), sensor, settings=settings, refitted=free)
    effects = context.initial_effects
    places = [position for position, effect in enumerate(effects) if effect.name in free]
    rows = settings.rows // 2
    return trace_and_fit(context, frames, effects, places, sample_size=rows).fitted.effects
