"""Draw frames of a drive and write a page with the pictures."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import cv2
import numpy as np

from cosim.drives.kitti import Drive, encode_rgb
from cosim.drives.writer import explained
from cosim.view.birds_eye import GroundPlan, draw_from_above
from cosim.view.camera_images import straight_image
from cosim.view.captions import Caption
from cosim.view.colours import Scale
from cosim.view.facts import drive_facts, frame_facts
from cosim.view.frame_pictures import Absent, FramePictures, intensity_scale
from cosim.view.page import GENERATOR, FrameSection, Missing, Page, ShownPicture, Thumbnail, format_page
from cosim.view.selection import spread_evenly
from cosim.view.titles import drive_title

_PICTURES = "pictures"
_OVERVIEW_FRAMES = 8
_THUMBNAIL_PX = (414, 125)


def write_view(
    drive: Drive,
    names: tuple[str, ...],
    folder: Path,
    on_frame: Callable[[str], None] = lambda name: None,
    *,
    file: str = "index.html",
) -> Path:
    """Write a page of pictures and `folder/pictures/*.png`; pictures of an earlier page are removed.

    Args:
        drive: drive.
        names: frames for which all pictures are drawn.
        folder: output folder; created if it does not exist.
        on_frame: called with the name of every frame before it is drawn.
        file: file name of the page.

    Returns:
        The path of the page.

    Raises:
        OutputError: the folder cannot be written.
        CosimError: a part of a frame is damaged.
    """
    index = folder / file
    with explained(folder):
        (folder / _PICTURES).mkdir(parents=True, exist_ok=True)
        _remove_pictures(index)
    intensity = intensity_scale(drive, names)
    sections = []
    for name in names:
        on_frame(name)
        sections.append(_draw_frame(drive, name, intensity, folder))
    overview = [
        _draw_thumbnail(drive, name, intensity, folder, shown=name in names)
        for name in sorted({*names, *spread_evenly(drive.frames, max(0, _OVERVIEW_FRAMES - len(names)))})
    ]
    page = Page(drive_title(drive), drive_facts(drive), drive.missing, overview, sections)
    with explained(index):
        index.write_text(format_page(page), encoding="utf-8", newline="\n")
    return index


def _draw_frame(drive: Drive, name: str, intensity: Scale, folder: Path) -> FrameSection:
    frame_pictures = FramePictures(drive, name, intensity)
    shown, missing = [], []
    for picture in frame_pictures:
        if isinstance(picture, Absent):
            missing.append(Missing(picture.caption.title, picture.reason))
        else:
            shown.append(_save(picture.image, picture.caption, name, folder))
    facts = frame_facts(frame_pictures.frame, frame_pictures.objects, frame_pictures.instances)
    return FrameSection(name, facts, shown, missing)


def _save(image: np.ndarray, caption: Caption, name: str, folder: Path) -> ShownPicture:
    file = f"{_PICTURES}/{name}-{caption.key}.png"
    with explained(folder / file):
        (folder / file).write_bytes(encode_rgb(image))
    return ShownPicture(file, caption, image.shape[1], image.shape[0])


def _draw_thumbnail(drive: Drive, name: str, intensity: Scale, folder: Path, *, shown: bool) -> Thumbnail:
    """The camera image if there is one, else the scan from above."""
    frame = drive[name]
    folder_name = next((part for part in ("image_2", "image_0") if frame.has(part)), None)
    if folder_name is not None:
        image = straight_image(frame, folder_name)
        image = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    else:
        width, height = _THUMBNAIL_PX
        image = draw_from_above(frame.points, intensity.colours(frame.points[:, 3]), GroundPlan(40, width * 2))
        image = image[width - height : width + height]
    small = cv2.resize(image, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA)
    saved = _save(small, Caption("overview", "", ""), name, folder)
    return Thumbnail(name, saved.file, saved.width, saved.height, shown)


def _remove_pictures(index: Path) -> None:
    """Remove the pictures of a page that was written to this folder before."""
    if not index.is_file():
        return
    text = index.read_text(encoding="utf-8", errors="replace")
    if f'<meta name="generator" content="{GENERATOR}">' not in text:
        return
    for reference in re.findall(rf'src="({_PICTURES}/[^"/]+\.png)"', text):
        (index.parent / _PICTURES / Path(unquote(reference)).name).unlink(missing_ok=True)
