"""Results of segments in files, so that an interrupted run can be resumed and memory holds one segment only."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drives.files import read_bytes
from cosim.drives.writer import explained
from cosim.engine import Do, Engine, JobEvent, Tell
from cosim.recordings.mapping.build import BuiltMap, NoMapError
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.segments import Segment
from cosim.recordings.mapping.surfels import Surfels
from cosim.recordings.scan import RecordingError
from sensors.npz import NpzError, npz_arrays, npz_bytes

Arrays = Mapping[str, np.ndarray]
Make = Callable[[Segment, Callable[[], object]], Arrays]
"""Makes something of a segment; calls the second argument now and then."""

_ABOUT, _REFUSED = "about", "refused"
_SURFELS = ("surfels", "left_out")
_PLAIN = ("poses", "motion", "pose_ego", "ground", "trusted", "error_m", "on_map", "held", "rounds")


@dataclass(frozen=True)
class Kept:
    """Files of what is made of segments.

    Attributes:
        folder: of the files.
        stem: start of the files' names.
        about: inputs that the files depend on; files made from other inputs are made again.
        make: one.
    """

    folder: Path
    stem: str
    about: str
    make: Make

    def file(self, segment: Segment) -> Path:
        """File of a segment."""
        return self.folder / f"{self.stem}_{segment.number:04d}.npz"

    def has(self, segment: Segment) -> bool:
        """Whether a segment's file is there, whole and of the same."""
        try:
            return self.file(segment).is_file() and _text(self.read(segment)[_ABOUT]) == self.about
        except (NpzError, KeyError):
            return False

    def read(self, segment: Segment) -> Arrays:
        """Read the results of a segment."""
        return npz_arrays(read_bytes(self.file(segment)))

    def write(self, segment: Segment, arrays: Arrays) -> None:
        """Keep it, whole or not at all."""
        file = self.file(segment)
        with explained(file):
            file.parent.mkdir(parents=True, exist_ok=True)
            new = file.with_suffix(".new")
            new.write_bytes(npz_bytes({**arrays, _ABOUT: _bytes(self.about)}))
            new.replace(file)

    @contextmanager
    def open(self, threads: int) -> Any:
        """Does segments, as a job of an engine."""

        def do(segment: Segment, tell: Tell) -> None:
            tell(JobEvent("ready"))
            self.write(segment, self.make(segment, lambda: tell(JobEvent("alive"))))
            tell(JobEvent("frame"))

        yield do

    def all_made(
        self,
        segments: Sequence[Segment],
        engine: Engine | None = None,
        on_segment: Callable[[int], object] = lambda done: None,
    ) -> None:
        """Make what is not there.

        Args:
            segments: all.
            engine: whose processes share them; by default this process makes one after the other.
            on_segment: called with the number of finished segments.

        Raises:
            RecordingError: a scan is damaged.
        """
        left = [segment for segment in segments if not self.has(segment)]
        done = len(segments) - len(left)

        def tell(event: JobEvent) -> None:
            nonlocal done
            if event.kind == "frame":
                done += 1
                on_segment(done)

        on_segment(done)
        if engine is not None and left and len(segments) > 1:
            skipped = engine.share_out(self, left, tell)
            if skipped:
                raise RecordingError(
                    f"segment {skipped[0].task.number} failed twice, because {skipped[0].reason}; run again to go on"
                )
            return
        with self.open(1) as do:
            do_all(do, left, tell)


def do_all(do: Do, segments: Sequence[Segment], tell: Tell) -> None:
    """One after the other."""
    for segment in segments:
        do(segment, tell)


def digest(*things: object) -> str:
    """A short name of some values that JSON can write."""
    return hashlib.sha256(json.dumps(things, sort_keys=True, default=str).encode()).hexdigest()[:16]


def arrays_of_path(path: Trajectory) -> Arrays:
    """A trajectory as arrays."""
    return {
        "poses": path.poses,
        "motion": path.motion,
        "doubtful": np.array(path.doubtful, np.int64),
        "source": _bytes(path.source),
        "turns": path.turns,
        "from_odometry": np.array([path.from_odometry], np.uint8),
    }


def path_of(arrays: Arrays) -> Trajectory:
    """Return the trajectory stored in arrays."""
    return Trajectory(
        poses=arrays["poses"],
        motion=arrays["motion"],
        doubtful=tuple(arrays["doubtful"].tolist()),
        source=_text(arrays["source"]),
        turns=arrays["turns"],
        from_odometry=bool(arrays["from_odometry"][0]),
    )


def arrays_of_map(make: Callable[[], BuiltMap]) -> Arrays:
    """A map as arrays, or why there is none."""
    try:
        made = make()
    except NoMapError as error:
        return {_REFUSED: _bytes(str(error))}
    surfels = {
        f"{part}.{name}": getattr(getattr(made, part), name)
        for part in _SURFELS
        for name in Surfels.__dataclass_fields__
    }
    plain = {name: np.asarray(getattr(made, name)) for name in _PLAIN}
    return {
        **surfels,
        **plain,
        "held_out": np.array(made.held_out, np.int64),
        "flags": np.array([made.no_plane, made.mount_known], np.int64),
    }


def map_of(arrays: Arrays) -> BuiltMap:
    """Return the map stored in arrays.

    Raises:
        NoMapError: there is no map; the arrays contain the reason.
    """
    if _REFUSED in arrays:
        raise NoMapError(_text(arrays[_REFUSED]))
    surfels = {
        part: Surfels(**{name: arrays[f"{part}.{name}"] for name in Surfels.__dataclass_fields__}) for part in _SURFELS
    }
    plain: dict[str, Any] = {name: arrays[name] for name in _PLAIN}
    plain["rounds"] = tuple(tuple(row) for row in plain["rounds"].tolist())
    no_plane, known = arrays["flags"].tolist()
    return BuiltMap(
        **surfels, **plain, held_out=tuple(arrays["held_out"].tolist()), no_plane=no_plane, mount_known=bool(known)
    )


def _bytes(text: str) -> np.ndarray:
    return np.frombuffer(text.encode() or b" ", np.uint8)


def _text(array: np.ndarray) -> str:
    return array.tobytes().decode()
