"""Write the page as one self-contained file, without server or network access."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cosim.drives.writer import explained
from cosim.view.interactive.drives import ShownDrives
from cosim.view.interactive.page import frame_element, page_parts


def write_interactive(
    shown: ShownDrives,
    file: Path,
    *,
    pictures: str | None = None,
    on_frame: Callable[[str], None] = lambda name: None,
) -> int:
    """Write the page atomically.

    Args:
        shown: drives to show.
        file: file to write; its folder is created if it does not exist.
        pictures: relative link to the page of pictures, if there is one.
        on_frame: called with the name of every frame before it is packed.

    Returns:
        The size of the file [bytes].

    Raises:
        OutputError: the file cannot be written.
        CosimError: a part of a frame is damaged.
    """
    head, tail = page_parts(shown.settings(served=False), shown.absences(), pictures=pictures)
    unfinished = file.with_name(f".{file.name}.unfinished")
    with explained(file):
        file.parent.mkdir(parents=True, exist_ok=True)
    try:
        with explained(file), unfinished.open("w", encoding="utf-8", newline="\n") as page:
            page.write(head)
            for step in shown.steps:
                on_frame(step[0])
                for drive, name in enumerate(step):
                    page.write(frame_element("frame", drive, name, shown.records[drive].whole(name)))
            page.write(tail)
        with explained(file):
            unfinished.replace(file)
    finally:
        unfinished.unlink(missing_ok=True)
    return file.stat().st_size
