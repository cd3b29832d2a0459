"""`cosim twin` for labelled drives: write a measured drive with a twin made from its labels and points."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import yaml

from assets import MATERIALS, build_model
from cosim.drives.kitti import Drive, Frame, format_calibration
from cosim.drives.kitti.point_format import OPTIONS
from cosim.drives.twin import encode_glb, encode_trust, format_materials
from cosim.drives.writer import DriveWriter, OutputError, explained, partial_of
from cosim.errors import FormatError
from cosim.labelled_twin.frame_twin import FrameTwin, check_labelled, make_frame_twin
from cosim.labelled_twin.trusted_ground import GROUND_MATERIAL
from cosim.labelled_twin.untrusted import why_untrusted
from sensors.pattern import Pattern, load_pattern

KITTI_PATTERN = "hdl64e_kitti"
_LINKED = ("velodyne", "rays", "image_0", "image_1", "image_2", "image_3", "calib", "label_2", "oxts")


@dataclass
class TwinSummary:
    """Summary of a new drive.

    Attributes:
        folder: folder of the new drive.
        frames: names of the frames in order.
        rows: counts and quality figures of each frame's twin.
        notes: missing inputs and assumptions, one sentence each.
    """

    folder: Path
    frames: list[str] = field(default_factory=list)
    rows: list[dict[str, float | int | bool | None]] = field(default_factory=list)
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, object]:
        """Values for `--json`."""
        points = sum(int(row["points"] or 0) for row in self.rows)
        trusted = sum(int(row["points_trusted"] or 0) for row in self.rows)
        spreads = [float(row["ground_sd_m"]) for row in self.rows if row["ground_sd_m"] is not None]
        return {
            "out": str(self.folder),
            "frames": len(self.frames),
            "points": points,
            "points_trusted_share": trusted / points if points else None,
            "ground_sd_m": float(np.median(spreads)) if spreads else None,
            "frames_with_ground": len(spreads),
            "frames_with_ground_range": sum(bool(row["ground_range"]) for row in self.rows),
            "objects": sum(int(row["objects"] or 0) for row in self.rows),
            "objects_without_model": sum(int(row["objects_without_model"] or 0) for row in self.rows),
            "notes": list(self.notes),
            "per_frame": {name: row for name, row in zip(self.frames, self.rows, strict=True)},
        }


def write_labelled_twin(
    drive: Drive,
    names: Sequence[str],
    folder: Path,
    pattern: str | None = None,
    on_frame: Callable[[str], None] = lambda name: None,
) -> TwinSummary:
    """Write a drive with twins of the given frames, or resume an interrupted one.

    Args:
        drive: measured drive with labels.
        names: names of the frames.
        folder: folder of the new drive; its scans and images are hard links to the originals if possible.
        pattern: name or path of the beam pattern, which is also used to recover rings if there are no `rays/`; by
            default the drive's own, or that of KITTI's sensor.
        on_frame: called after each frame.

    Raises:
        CosimError: a frame has no labels or is damaged, no point of any frame can be trusted, or the folder cannot be
            used.
        SensorError: the pattern does not exist.
    """
    if folder.resolve() == drive.root.resolve():
        raise OutputError(f"{folder} is the measured drive itself; choose another --out")
    beams = load_pattern(pattern or drive.pattern or KITTI_PATTERN)
    frames = [_read_frame(drive, name, beams if pattern else None) for name in names]
    for frame in frames:
        check_labelled(frame)
    notes = _notes(drive, names, pattern)
    writer = DriveWriter(folder)
    settings: dict[str, object] = {"kind": "measured", "source": str(drive.root.resolve()), "twin": "labels"}
    settings |= {"pattern": beams.name} | {key: drive.info[key] for key in OPTIONS if key in drive.info}
    if drive.point_format.schema is not None:
        settings["inferred"] = drive.point_format.schema.as_dict()
    if drive.label_axes[1] or "label_axes" in drive.info:
        settings["label_axes"] = drive.label_axes[0]
    if drive.label_axes[1]:
        settings["inferred"] = {**dict(settings.get("inferred") or {}), "label_axes": drive.label_axes[1]}  # type: ignore[call-overload]
    writer.open(yaml.safe_dump(settings | {"cosim": version("cosim")}, sort_keys=False))
    done = writer.manifest()
    for frame in frames:
        if frame.name not in done:
            _write_frame(writer, frame, make_frame_twin(frame, beams))
        on_frame(frame.name)
    _check_trust(writer, drive, frames, beams)
    return _finish(writer, list(names), beams, settings, notes)


def _read_frame(drive: Drive, name: str, beams: Pattern | None) -> Frame:
    """Read a frame; if `beams` is given, its rings are recovered with that pattern instead of the drive's."""
    frame = drive[name]
    return frame if beams is None else replace(frame, elevations_rad=np.radians(np.array(beams.elevation_deg)))


def _check_trust(writer: DriveWriter, drive: Drive, frames: Sequence[Frame], beams: Pattern) -> None:
    """Raise FormatError if no point of these frames is on a trusted surface of the twin."""
    entries = writer.manifest()
    if any(entries[frame.name]["counts"]["points_trusted"] for frame in frames):
        return
    fullest = max(frames, key=lambda frame: entries[frame.name]["counts"]["points"])
    raise FormatError(
        f"{drive.root}: the twin contains no surface that {len(frames)} scans show, so nothing could be compared with "
        f"it; {why_untrusted(fullest, beams)}. {writer.folder} is incomplete: remove it"
    )


def _write_frame(writer: DriveWriter, frame: Frame, made: FrameTwin) -> None:
    for part in _LINKED:
        source = frame.find(part)
        if part == "calib" and frame.common_calibration is not None:
            writer.write(f"calib/{frame.name}.txt", format_calibration(frame.calibration).encode())
        elif source is not None:
            _link(source, writer.folder / part / source.name)
    for model in sorted({instance.model for instance in made.frame.instances}):
        if not writer.has(f"twin/models/{model}.glb"):
            writer.write(f"twin/models/{model}.glb", encode_glb(build_model(model), model))
    files = {
        f"twin/worlds/{frame.name}.glb": encode_glb(made.ground, frame.name),
        f"twin/trust/{frame.name}.npz": encode_trust(made.trust),
        f"twin/frames/{frame.name}.json": made.frame.to_json().encode(),
    }
    counts = {
        "points": made.points,
        "points_bad": frame.bad_points,
        "points_trusted": made.points_trusted,
        "objects": len(made.frame.instances),
        "objects_without_model": made.objects_without_model,
        "points_ground": made.ground_brightness.points,
    }
    writer.write_frame(
        frame.name,
        files,
        counts,
        ground_range=made.trust.ground_range,
        ground_sd_m=round(made.ground_sd_m, 5) if made.trust.ground.any() else -1.0,
        cone_deg=round(made.trust.cone_deg, 5),
        ground_intensity=round(made.ground_brightness.mean, 5),
    )


def _link(source: Path, target: Path) -> None:
    """Hard-link a file, or copy it if the file system does not support links; atomic."""
    with explained(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = partial_of(target)
        partial.unlink(missing_ok=True)
        try:
            partial.hardlink_to(source.resolve())
        except OSError:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            shutil.copyfile(source, partial)
        partial.replace(target)


def _notes(drive: Drive, names: Sequence[str], pattern: str | None) -> tuple[str, ...]:
    resolved = ("twin/", "the beam pattern is not given", "sweep_s is not given")
    notes = [note for note in drive.notes(names) if not note.startswith(resolved)]
    notes.append("labels contain no motion: the ego vehicle and the objects are at rest in the twin")
    notes.append("labels contain no reflectances: road and objects have the mean intensity of their points")
    if drive.pattern is None and pattern is None:
        notes.append(f"the beam pattern is not given: {KITTI_PATTERN} (KITTI's sensor) and its sweep are assumed")
    return tuple(notes)


def _finish(
    writer: DriveWriter, names: list[str], beams: Pattern, settings: dict[str, object], notes: tuple[str, ...]
) -> TwinSummary:
    entries = writer.manifest()
    rows = [_row(entries[name]) for name in names]
    files = {
        "pattern.yaml": beams.to_yaml().encode(),
        "twin/materials.yaml": format_materials(MATERIALS, _reflectances(entries.values())).encode(),
        "ImageSets/all.txt": "".join(f"{name}\n" for name in sorted(entries)).encode(),
    }
    summary = TwinSummary(writer.folder, names, rows, notes)
    facts = {key: value for key, value in summary.as_json().items() if key not in ("out", "per_frame", "notes")}
    head = yaml.safe_dump(settings | {"cosim": version("cosim")}, sort_keys=False)
    tail = {"sweep_s": beams.sweep_s, "counts": facts, "notes": list(notes)}
    writer.finish(files, head + yaml.safe_dump(tail, sort_keys=False, allow_unicode=True, width=200))
    return summary


def _reflectances(entries: Iterable[dict]) -> dict[str, float]:
    """Reflectance of the ground's material over all frames; empty if there are no intensities."""
    measured = [
        (entry["ground_intensity"], entry["counts"]["points_ground"])
        for entry in entries
        if "ground_intensity" in entry
    ]
    points = sum(count for _, count in measured)
    return {GROUND_MATERIAL: round(sum(mean * count for mean, count in measured) / points, 4)} if points else {}


def _row(entry: dict) -> dict[str, float | int | bool | None]:
    has_ground = entry["ground_sd_m"] >= 0
    return {
        **entry["counts"],
        "ground_range": bool(entry["ground_range"]),
        "ground_sd_m": entry["ground_sd_m"] if has_ground else None,
        "cone_deg": entry["cone_deg"] if entry["ground_range"] else None,
    }
