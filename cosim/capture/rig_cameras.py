"""Render the images of a rig's cameras."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from cosim.capture.camera_views import effect_camera, view_of_images
from cosim.capture.placed_rig import PlacedCamera, PlacedRig
from cosim.capture.products import cameras_of, wanted_of
from cosim.drives.twin import TwinCamera
from cosim.scene.lamps import without_signals
from cosim.scene.site import Models, Site
from sensors.camera_view import CameraView
from sensors.cameras import CameraRenderer, Content, Images, Light
from sensors.cameras.cast_shadows import CastShadows
from sensors.cameras.images import CONTENTS
from sensors.cameras.texture import fields_of, textured
from sensors.scene import Instances
from sensors.sensor_model import SensorModel

_IMAGE_STREAM = 5  # random stream of the image noise, independent of the frame's other random numbers


@dataclass(frozen=True, eq=False)
class RenderedImages:
    """Images of the cameras at one instant.

    Attributes:
        images: images with lens distortion, as stored, by camera.
        undistorted: the same images without lens distortion, by camera.
        view: camera view for effects; None if no effect uses one.
    """

    images: Mapping[str, Images]
    undistorted: Mapping[str, Images]
    view: CameraView | None


class RigCameras:
    """Renders the camera images that a run needs.

    Args:
        rig: poses and properties of the cameras.
        products: names of the image folders to write.
        models: meshes of the instances.
        backend: OpenGL backend, `osmesa` or `egl`.
        sensor: sensor of the LiDAR whose reflectance fields give images their texture.
        needs_view: whether an effect uses a camera view.
        seed: seed of the run.
    """

    def __init__(
        self,
        rig: PlacedRig,
        products: Sequence[str],
        models: Models,
        backend: str,
        *,
        sensor: SensorModel,
        needs_view: bool,
        seed: int,
    ) -> None:
        self._rig, self._models, self._backend, self._seed = rig, models, backend, seed
        self._view_camera = effect_camera(tuple(rig.cameras), rig.reference) if needs_view else None
        self.labelled = tuple(name for name, camera in rig.cameras.items() if camera.calibration is not None)
        needed = [*products, *(f"instance_{name}" for name in self.labelled)]
        if self._view_camera is not None:
            needed += [f"image_{self._view_camera}", f"depth_{self._view_camera}"]
        self.used = {name: rig.cameras[name] for name in cameras_of(needed)}
        self._fields = fields_of(sensor) if any(camera.imaging.texture for camera in self.used.values()) else ()
        self._contents = {name: _with_shadows(wanted_of(name, needed)) for name in self.used}
        self._renderers: dict[tuple[int, int], CameraRenderer] = {}
        self._shadows: CastShadows | None = None

    def enter(self, site: Site, light: Light) -> None:
        """Switch to another site, or to another light."""
        for camera in self.used.values():
            self._renderer(camera)
        for renderer in self._renderers.values():
            site.show(renderer, light)
        self._shadows = CastShadows(self._models.load, light, site.scene.static)

    def leave(self) -> None:
        """Release the current site; `enter` is needed before the next image."""
        for renderer in self._renderers.values():
            renderer.enter(Mesh.empty(), Light())
        self._shadows = None

    def render(
        self, frame: str, ego_pose: np.ndarray, lidar_pose_ego: np.ndarray, instances: Instances, with_lights: Instances
    ) -> RenderedImages:
        """Render all cameras.

        Args:
            frame: name of the frame.
            ego_pose: (4, 4) pose of the carrier in the world.
            lidar_pose_ego: (4, 4) pose of the first LiDAR on the carrier.
            instances: movable objects.
            with_lights: the same objects with lit lamps, followed by the lit lenses of traffic signals.
        """
        assert self._shadows is not None
        images, undistorted = {}, {}
        for name, camera in self.used.items():
            pose = ego_pose @ (lidar_pose_ego @ camera.in_lidar)
            P = camera.P if camera.lens is None else camera.lens.source_projection
            pinhole = self._renderer(camera).render(pose, P, with_lights, self._contents[name])
            if len(with_lights) > len(instances):
                pinhole = without_signals(pinhole, len(instances))
            if "colour" in self._contents[name]:
                pinhole = self._shadows.onto(pinhole, pose, P, instances)
                pinhole = textured(pinhole, camera.imaging.texture, pose, P, instances, self._fields)
            distorted = pinhole if camera.lens is None else camera.lens.bent(pinhole)
            rng = np.random.default_rng([self._seed, int(frame), zlib.crc32(name.encode()), _IMAGE_STREAM])
            images[name] = camera.imaging.seen(distorted, rng)
            undistorted[name] = images[name] if camera.lens is None else camera.lens.straight(pinhole)
        return RenderedImages(images, undistorted, self._view(ego_pose, lidar_pose_ego, undistorted))

    def twins(self, lidar_pose_ego: np.ndarray) -> dict[str, TwinCamera]:
        """The cameras as the twin stores them, by image folder."""
        return {
            f"image_{name}": TwinCamera(
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
        self, ego_pose: np.ndarray, lidar_pose_ego: np.ndarray, undistorted: Mapping[str, Images]
    ) -> CameraView | None:
        if self._view_camera is None or self.used[self._view_camera].lens is not None:
            return None
        camera = self.used[self._view_camera]
        return view_of_images(undistorted[camera.name], camera.P, ego_pose @ (lidar_pose_ego @ camera.in_lidar))

    def _renderer(self, camera: PlacedCamera) -> CameraRenderer:
        """Renderer for images of the camera's size; created on first use."""
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


def _with_shadows(contents: frozenset[Content]) -> frozenset[Content]:
    """Add the contents that are needed to draw shadows into colour images."""
    return frozenset(CONTENTS) if "colour" in contents else contents
