"""Selection and reading of training and test frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from cosim.drives.kitti import Drive
from cosim.drives.kitti.layout import read_split
from training.data.frame import TrainingSample, read_sample
from training.errors import TrainingError


class FrameSource(BaseModel):
    """Frames of one drive, simulated or real."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    drive: Path = Field(description="folder of the drive, in cosim's or KITTI's layout")
    split: str | None = Field(default=None, description="a list of its ImageSets/, such as train; none: all frames")
    frames: Path | None = Field(default=None, description="instead: a file of names, one per line")
    count: int | None = Field(default=None, ge=1, description="number of evenly spaced frames of the list")

    def open(self) -> tuple[Drive, tuple[str, ...]]:
        """Return the drive, and the names of the selected frames.

        Raises:
            TrainingError: both a split and a file are given, or a name is not in the drive.
            DriveError: no such drive or split.
        """
        drive = Drive(self.drive)
        if self.split is not None and self.frames is not None:
            raise TrainingError(f"{self.drive}: both split {self.split!r} and frames {self.frames} are given; keep one")
        names = drive.frames
        if self.split is not None:
            names = drive.split(self.split)
        if self.frames is not None:
            names = tuple(read_split(self.frames))
            absent = [name for name in names if name not in drive]
            if absent:
                raise TrainingError(
                    f"{self.frames}: {len(absent)} of its frames are not in {self.drive}, first {absent[0]}"
                )
        if self.count is not None and self.count < len(names):
            names = tuple(names[i * len(names) // self.count] for i in range(self.count))
        return drive, names


def read_samples(
    sources: Sequence[FrameSource], classes: Sequence[str], on_frame: Callable[[], None] = lambda: None
) -> list[TrainingSample]:
    """Read all frames of the sources.

    Raises:
        TrainingError: there are no frames, or no frame has an object of the classes.
    """
    samples = []
    for source in sources:
        drive, names = source.open()
        for name in names:
            samples.append(read_sample(drive[name], classes))
            on_frame()
    if not sources:
        raise TrainingError("the training set is empty: name at least one drive under `train`")
    if not samples:
        named = ", ".join(str(source.frames or source.split or source.drive) for source in sources)
        raise TrainingError(f"the training set is empty: {named} contains no frame; choose another list or drive")
    if not any((sample.class_ids >= 0).any() for sample in samples):
        raise TrainingError(
            f"the training set is empty: none of its {len(samples)} frames has a labelled {' or '.join(classes)} "
            "with enough points; choose other frames or `classes`"
        )
    return samples
