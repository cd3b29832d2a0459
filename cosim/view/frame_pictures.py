"""Draw all pictures of one frame in the order of the page; report the reason for pictures that cannot be drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Boxes, Drive, Frame, PointRays, read_depth
from cosim.drives.kitti.level import levelled
from cosim.errors import FormatError
from cosim.view import captions
from cosim.view.birds_eye import GroundPlan, draw_from_above, draw_outlines, name_boxes
from cosim.view.camera import ENLARGED, draw_depth, draw_labels, draw_points, enlarge
from cosim.view.camera_images import straight_image
from cosim.view.captions import Caption
from cosim.view.colours import BACKGROUND, TEXT, Scale, colour_by_instance
from cosim.view.drawing import draw_colour_bar, draw_text
from cosim.view.objects import Objects, PointInstances, find_instances, find_objects, labelled_boxes
from cosim.view.perspective import chase_view, close_view, draw_perspective, draw_wires
from cosim.view.projection import Viewpoint
from cosim.view.range_image import RangeGrid, draw_range_image, nearest_points
from sensors.pattern import load_pattern

DISTANCE = Scale("depth [m]", 3, 80, "turbo", near_is_warm=True, logarithmic=True)
RANGE = Scale("range [m]", 3, 80, "turbo", near_is_warm=True, logarithmic=True)
_MIN_POINTS = 5  # for an object to be outlined
_NO_OBJECTS = "objects are unknown: there are neither labels nor a twin"
_RECOVERED_COLUMNS = 1800  # recovered azimuths vary by half a step; wider cells avoid false gaps
_FEWEST_POINTS = 60
_MOST = 4
_GAP_PX = 6
_WIDTH_PX = 1606
_HEIGHT_PX = 540


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture: caption and pixels (h, w, 3) uint8 RGB."""

    caption: Caption
    image: np.ndarray


@dataclass(frozen=True)
class Absent:
    """A picture that cannot be drawn, and the reason."""

    caption: Caption
    reason: str


class FramePictures:
    """Draws one frame; iterating over it yields a `Picture` or `Absent` for each caption.

    Args:
        drive: drive.
        name: name of the frame.
        intensity: colour scale of intensities, the same for all frames of a page.

    Attributes:
        frame: frame.
        objects: objects of the frame.
        instances: object of every point.
    """

    def __init__(self, drive: Drive, name: str, intensity: Scale) -> None:
        self.frame: Frame = levelled(drive[name])
        self._drive = drive
        self._intensity = intensity
        self.objects: Objects = find_objects(self.frame)
        self.instances: PointInstances = find_instances(drive, self.frame, self.objects)
        self._labelled: Boxes = labelled_boxes(self.frame)
        self._classes = self.frame.labels.cared_for.type if self.frame.has("label_2") else ()
        self._counts = np.bincount(self.instances.number + 1, minlength=len(self.objects) + 1)[1:]
        points = self.frame.points
        self._by_intensity = intensity.colours(points[:, 3])
        self._by_instance = colour_by_instance(self.instances.number, intensity.share(points[:, 3]))

    def __iter__(self) -> Iterator[Picture | Absent]:
        yield from self._cameras()
        yield from self._perspectives()
        yield from self._plans()
        yield self._close_ups()
        yield from self._range_images()
        yield self._depth()

    def _visible_objects(self) -> tuple[Boxes, tuple[str, ...]]:
        """Boxes and kinds of the objects with enough points."""
        rows = np.flatnonzero(self._counts >= _MIN_POINTS)
        return self.objects.boxes[rows], tuple(self.objects.kinds[row] for row in rows)

    def _perspectives(self) -> Iterator[Picture | Absent]:
        points, view = self.frame.points, chase_view()
        image = draw_perspective(points, self._by_intensity, view)
        draw_wires(image, self._labelled, self._classes, view)
        yield Picture(captions.PERSPECTIVE_INTENSITY, self._with_bar(image))
        if self.objects.source == "none":
            yield Absent(captions.PERSPECTIVE_INSTANCE, _NO_OBJECTS)
            return
        image = draw_perspective(points, self._by_instance, view)
        draw_wires(image, *self._visible_objects(), view)
        yield Picture(captions.PERSPECTIVE_INSTANCE, image)

    def _plans(self) -> Iterator[Picture | Absent]:
        points, plan = self.frame.points, GroundPlan()
        image = draw_from_above(points, self._by_intensity, plan)
        draw_outlines(image, self._labelled, self._classes, plan, thickness=2)
        name_boxes(image, self._labelled, self._classes, plan)
        yield Picture(captions.ABOVE_INTENSITY, self._with_bar(image))
        if self.objects.source == "none":
            yield Absent(captions.ABOVE_INSTANCE, _NO_OBJECTS)
            return
        image = draw_from_above(points, self._by_instance, plan)
        draw_outlines(image, self.objects.boxes, self.objects.kinds, plan)
        name_boxes(image, *self._visible_objects(), plan)
        yield Picture(captions.ABOVE_INSTANCE, image)

    def _close_ups(self) -> Picture | Absent:
        if not len(_best_seen(self._counts)):
            return Absent(captions.CLOSE_UPS, f"no object has {_FEWEST_POINTS} points")
        return Picture(
            captions.CLOSE_UPS,
            _draw_close_ups(self.frame.points, self._by_instance, self.objects, self._counts),
        )

    def _range_images(self) -> Iterator[Picture | Absent]:
        points = self.frame.points
        try:
            rays = self.frame.rays
        except FormatError as error:
            if self.frame.has("rays"):
                raise
            yield Absent(captions.RANGE, str(error))
            yield Absent(captions.RANGE_INTENSITY, "see the range image")
            return
        distance = np.linalg.norm(points[:, :3], axis=1)
        cells = nearest_points(rays.ring, rays.azimuth, distance, self._grid(rays))
        yield Picture(captions.RANGE, draw_range_image(cells, distance, RANGE))
        yield Picture(captions.RANGE_INTENSITY, draw_range_image(cells, points[:, 3], self._intensity))

    def _grid(self, rays: PointRays) -> RangeGrid:
        rings = max(64, int(rays.ring.max(initial=0)) + 1)
        if rays.recovered or self._drive.pattern is None:
            return RangeGrid(rings, _RECOVERED_COLUMNS)
        pattern = load_pattern(self._drive.pattern)
        return RangeGrid(pattern.rings, pattern.firings)

    def _cameras(self) -> Iterator[Picture | Absent]:
        folder = next((part for part in ("image_2", "image_0") if self.frame.has(part)), None)
        if folder is None:
            yield Absent(captions.CAMERA_DEPTH, "there is no image_2/ or image_0/")
            yield Absent(captions.CAMERA_BOXES, "there is no image_2/ or image_0/")
            return
        image = straight_image(self.frame, folder)
        view = Viewpoint.of_camera(self.frame.calibration, int(folder[-1]), image.shape[1], image.shape[0])
        view, image = view.enlarged(ENLARGED), enlarge(image)
        if self.frame.has("label_2"):
            yield Picture(captions.CAMERA_BOXES, draw_labels(image, self.frame.labels, self._labelled, view))
        else:
            yield Absent(captions.CAMERA_BOXES, "there is no label_2/")
        yield Picture(captions.CAMERA_DEPTH, draw_points(image, self.frame.points, view, DISTANCE))

    def _depth(self) -> Picture | Absent:
        part = f"depth_{self.frame.reference or 0}"
        if not self.frame.has(part):
            return Absent(captions.DEPTH, f"there is no {part}/")
        return Picture(captions.DEPTH, draw_depth(read_depth(self.frame.path(part)), DISTANCE))

    def _with_bar(self, image: np.ndarray) -> np.ndarray:
        bottom = image.shape[0]
        image[bottom - 64 :, :372] = BACKGROUND
        draw_colour_bar(image, self._intensity, (20, bottom - 40), (330, 13))
        return image


def intensity_scale(drive: Drive, names: tuple[str, ...]) -> Scale:
    """Colour scale from 0 to the 97.5 % quantile of the intensities in these frames."""
    tops = [np.percentile(points[:, 3], 97.5) for points in (drive[name].points for name in names) if len(points)]
    top = max(0.1, float(np.ceil(max(tops, default=1.0) * 20) / 20))
    return Scale("intensity", 0, top, "viridis", start=0.16)


def _best_seen(counts: np.ndarray) -> np.ndarray:
    """Rows of up to four objects with the most points, at least `_FEWEST_POINTS`."""
    order = np.argsort(-counts, kind="stable")[:_MOST]
    return order[counts[order] >= _FEWEST_POINTS]


def _draw_close_ups(points: np.ndarray, colours: np.ndarray, objects: Objects, counts: np.ndarray) -> np.ndarray:
    """Draw the objects selected by `_best_seen` (at least one) in rows of two; an odd last one has the full width.

    Args:
        points: (n, ≥ 3) in LiDAR axes [m].
        colours: (n, 3) uint8 RGB.
        objects: of the frame.
        counts: points of each object.
    """
    chosen = _best_seen(counts)
    strips = []
    for pair in (chosen[i : i + 2] for i in range(0, len(chosen), 2)):
        width = (_WIDTH_PX - _GAP_PX * (len(pair) - 1)) // len(pair)
        tiles = [_draw_tile(points, colours, objects, row, int(counts[row]), width) for row in pair]
        strips.append(_joined(tiles, axis=1))
    return _joined(strips, axis=0)


def _draw_tile(
    points: np.ndarray, colours: np.ndarray, objects: Objects, row: int, count: int, width: int
) -> np.ndarray:
    tile = draw_perspective(points, colours, close_view(objects.boxes, row, width, _HEIGHT_PX))
    distance = np.linalg.norm(objects.boxes.centre[row])
    text = f"{objects.kinds[row]}, {distance:.0f} m away, {count} points"
    draw_text(tile, text, (18, 18), 14, TEXT, plate=BACKGROUND)
    return tile


def _joined(images: list[np.ndarray], axis: int) -> np.ndarray:
    """Images side by side (axis 1) or stacked (axis 0) with a gap between them."""
    shape = list(images[0].shape)
    shape[axis] = _GAP_PX
    gap = np.full(shape, BACKGROUND, np.uint8)
    parts = [part for image in images for part in (gap, image)][1:]
    return np.concatenate(parts, axis=axis)
