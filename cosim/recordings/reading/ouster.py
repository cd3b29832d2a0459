"""Ouster's own recordings, through Ouster's SDK: packet captures (`.pcap` with their `.json`) and `.osf`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cosim.point_files import Columns
from cosim.recordings.libraries import needed
from cosim.recordings.reading.source import Source, capture_sources
from cosim.recordings.scan import RecordingError


def ouster_sources(path: Path) -> tuple[Source, ...]:
    """Scans of a capture, in order.

    Raises:
        RecordingError: the SDK is absent, there are no metadata, several sensors, or no scan.
    """
    return capture_sources(path, _scans, _columns)


def _scans(path: Path) -> Iterator[tuple[float, Any]]:
    """Time stamps [s] and scans of the SDK, in order."""
    sdk = needed("ouster.sdk", f"{path.name} (Ouster)")
    try:
        for frames in sdk.open_source(str(path)):
            frame = _only(path, frames)
            yield _stamp_s(frame), frame
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - the SDK raises whatever it meets
        reason = " ".join(str(error).split())[:160]
        raise RecordingError(
            f"{path}: Ouster's SDK cannot read it ({reason}); its metadata file NAME.json must be in the same folder. "
            "Packets of other sensors than Velodyne's are to be played through their driver, and its clouds recorded"
        ) from None


def _only(path: Path, frames: Any) -> Any:
    found = [frame for frame in frames if frame is not None] if hasattr(frames, "__iter__") else [frames]
    if len(found) != 1:
        raise RecordingError(f"{path}: {len(found)} sensors in one capture; give a capture of one")
    return found[0]


def _stamp_s(frame: Any) -> float:
    stamps = np.asarray(frame.timestamp, np.float64)
    return float(stamps[stamps > 0].min(initial=np.inf)) / 1e9 if (stamps > 0).any() else 0.0


def _columns(frame: Any) -> Columns:
    """Columns of one scan, its lasers numbered from the top."""
    core = needed("ouster.sdk.core", "an Ouster capture")
    xyz = np.asarray(core.XYZLut(frame.sensor_info)(frame), np.float64)  # (h, w, 3), a column a firing
    rows, firings = xyz.shape[:2]
    columns = {axis: xyz[..., number].T.reshape(-1) for number, axis in enumerate("xyz")}
    columns["ring"] = np.tile(np.arange(rows), firings)
    stamps = np.asarray(frame.timestamp, np.int64)
    columns["t"] = np.repeat(np.where(stamps > 0, stamps, stamps[stamps > 0].min(initial=stamps.max())), rows)
    for name in ("REFLECTIVITY", "SIGNAL"):
        if name in list(frame.fields):
            columns["intensity"] = np.asarray(frame.field(name)).T.reshape(-1)
            break
    return columns
