"""The cameras of a rig: what they render, and as what."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from cosim.capture.camera_views import seeing_camera, view_of_images
from cosim.capture.placed_rig import PlacedCamera, PlacedRig
from cosim.capture.products import cameras_of, wanted_of
from cosim.drives.twin import Camera
from cosim.scene.lamps import without_signals
from cosim.scene.site import Models, Site
from sensors.camera_view import CameraView
from sensors.cameras import CameraRenderer, Content, Images, Light
from sensors.cameras.cast_shadows import CastShadows
from sensors.cameras.images import CONTENTS
from sensors.scene import Instances

_IMAGE_STREAM = 5  # keeps the noise of images apart from other random numbers of a frame


@dataclass(frozen=True, eq=False)
class Seen:
    """What the cameras saw at one instant.

    Attributes:
        images: as they are stored, by camera.
        straight: the same without distortion, of those whose labels or light are wanted.
        view: what effects may know, or None where none asks.
    """

    images: Mapping[str, Images]
    straight: Mapping[str, Images]
    view: CameraView | None


class RigCameras:
    """Renders what a run needs of its cameras.

    Args:
        rig: where they are.
        products: folders of images that are written.
        models: as renderers need them.
        backend: `osmesa` or `egl`.
        lit: whether an effect takes its light from an image.
        seed: of the run.
    """

    def __init__(
        self, rig: PlacedRig, products: Sequence[str], models: Models, backend: str, *, lit: bool, seed: int
    ) -> None:
        self._rig, self._models, self._backend, self._seed = rig, models, backend, seed
        self._seeing = seeing_camera(tuple(rig.cameras), rig.reference) if lit else None
        self.labelled = tuple(name for name, camera in rig.cameras.items() if camera.calibration is not None)
        needed = [*products, *(f"instance_{name}" for name in self.labelled)]
        if self._seeing is not None:
            needed += [f"image_{self._seeing}", f"depth_{self._seeing}"]
        self.used = {name: rig.cameras[name] for name in cameras_of(needed)}
        self._wanted = {name: _with_shadows(wanted_of(name, needed)) for name in self.used}
        self._renderers: dict[tuple[int, int], CameraRenderer] = {}

    def enter(self, site: Site, light: Light) -> None:
        """See another place, or the same in another light, from now on."""
        for camera in self.used.values():
            self._renderer(camera)
        for renderer in self._renderers.values():
            site.show(renderer, light)
        self._shadows = CastShadows(self._models.load, light, site.scene.static)

    def look(
        self, frame: str, ego_pose: np.ndarray, lidar_pose_ego: np.ndarray, instances: Instances, lit: Instances
    ) -> Seen:
        """What they see from a vehicle at `ego_pose` with the first LiDAR at `lidar_pose_ego` on it, both (4, 4).

        Args:
            frame: its name.
            ego_pose, lidar_pose_ego: of the instant.
            instances: what moves.
            lit: the same with its lamps, and after them the lamps of signals.
        """
        images, straight = {}, {}
        for name, camera in self.used.items():
            pose = ego_pose @ (lidar_pose_ego @ camera.in_lidar)
            P = camera.P if camera.lens is None else camera.lens.source_projection
            found = self._renderer(camera).render(pose, P, lit, self._wanted[name])
            if len(lit) > len(instances):
                found = without_signals(found, len(instances))
            if "colour" in self._wanted[name]:
                found = self._shadows.onto(found, pose, P, instances)
            bent = found if camera.lens is None else camera.lens.bent(found)
            rng = np.random.default_rng([self._seed, int(frame), zlib.crc32(name.encode()), _IMAGE_STREAM])
            images[name] = camera.imaging.seen(bent, rng)
            straight[name] = images[name] if camera.lens is None else camera.lens.straight(found)
        return Seen(images, straight, self._view(ego_pose, lidar_pose_ego, straight))

    def twins(self, lidar_pose_ego: np.ndarray) -> dict[str, Camera]:
        """What the twin says of them, by folder of images."""
        return {
            f"image_{name}": Camera(
                lidar_pose_ego @ camera.in_lidar,
                camera.P,
                camera.width,
                camera.height,
                None if camera.lens is None else camera.lens.distortion,
            )
            for name, camera in self.used.items()
        }

    def close(self) -> None:
        """Free the renderers."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    def _view(
        self, ego_pose: np.ndarray, lidar_pose_ego: np.ndarray, straight: Mapping[str, Images]
    ) -> CameraView | None:
        if self._seeing is None or self.used[self._seeing].lens is not None:
            return None
        camera = self.used[self._seeing]
        return view_of_images(straight[camera.name], camera.P, ego_pose @ (lidar_pose_ego @ camera.in_lidar))

    def _renderer(self, camera: PlacedCamera) -> CameraRenderer:
        """What draws images of a camera's size; opened when first needed."""
        size = (camera.width, camera.height) if camera.lens is None else camera.lens.source_size
        if size not in self._renderers:
            self._renderers[size] = CameraRenderer(
                Mesh.empty(),
                self._models.load,
                Light(),
                width=size[0],
                height=size[1],
                backend=self._backend,
                packed=self._models.packed,
            )
        return self._renderers[size]


def _with_shadows(wanted: frozenset[Content]) -> frozenset[Content]:
    """What must be read back so that shadows can be put into colours."""
    return frozenset(CONTENTS) if "colour" in wanted else wanted
