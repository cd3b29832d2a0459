"""The frames of a drive, or of a folder that has only labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from cosim.drives.files import is_safe_name
from cosim.drives.kitti import Drive, Frame
from cosim.drives.kitti.layout import holds_scans, where_instead
from cosim.errors import DriveError

_BELOW = ("", "training", "testing")


class FrameSet:
    """Frames to take statistics of, read one after another.

    A folder with `velodyne/` is a drive; one with `label_2/` and no `velodyne/` is a set of labels.

    Attributes:
        root: the folder that holds `velodyne/` or `label_2/`.
        title: what to call it.
        kind: `simulated drive`, `measured drive` or `labels`.
        names: of the frames, sorted.
        notes: what is absent, a sentence each.
    """

    def __init__(self, path: str | Path, names: Sequence[str] | None = None) -> None:
        """Open the set at `path`, or some of its frames.

        Raises:
            DriveError: no such folder, neither scans nor labels in it, no frame, or not those that are named.
        """
        given = Path(path)
        if not given.is_dir():
            raise DriveError(f"{given}: {'not a folder' if given.exists() else 'no such folder'}; give that of a drive")
        self._drive: Drive | None = None
        if any(holds_scans(given / below) for below in _BELOW):
            self._drive = Drive(given)
            self.root, self.names = self._drive.root, self._drive.frames
            self.kind = f"{self._drive.kind} drive"
        else:
            root = next((given / below for below in _BELOW if (given / below / "label_2").is_dir()), None)
            if root is None:
                raise DriveError(
                    f"{given}: neither velodyne/ nor label_2/ here or in training/; {where_instead(given)}"
                )
            self.root, self.kind = root, "labels"
            self.names = tuple(sorted(f.stem for f in (root / "label_2").glob("*.txt") if is_safe_name(f.stem)))
            if not self.names:
                raise DriveError(f"{root / 'label_2'}: holds no .txt file; a set needs at least one frame")
        if names is not None:
            absent = sorted(set(names) - set(self.names))
            if absent or not names:
                raise DriveError(f"{self.root}: has no frame {absent[0] if absent else 'named'}; name frames it holds")
            self.names = tuple(sorted(set(names)))
        self.title = _title(self.root)
        self.notes = self._find_notes()

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over frames; each is released when the next is requested."""
        return (self._drive[name] if self._drive else Frame(name, self.root) for name in self.names)

    @property
    def labelled(self) -> bool:
        """Whether any frame has labels."""
        return any(frame.has("label_2") for frame in self)

    def _find_notes(self) -> tuple[str, ...]:
        notes = []
        if self._drive is None:
            notes.append("velodyne/ is absent: no statistics of points")
        absent = sum(not frame.has("label_2") for frame in self)
        if absent == len(self):
            notes.append("label_2/ is absent: no statistics of labelled objects")
        elif absent:
            notes.append(
                f"label_2/ is absent for {absent} of {len(self)} frames: those count in no statistics of labels"
            )
        if any(frame.has("label_2") and not frame.has("calib") for frame in self):
            notes.append("calib/ is absent: positions by the calibration of KITTI's drives of 26 September 2011")
        return tuple(notes)


def _title(root: Path) -> str:
    folder = root.resolve()
    return folder.parent.name if folder.name in _BELOW[1:] else folder.name
