"""Measures the world at one instant with every sensor of the rig and writes the frame."""

from __future__ import annotations

from functools import partial

import numpy as np

from assets import MATERIALS, Mesh, build_model
from assets.external import load_external
from cosim.capture.background import BackgroundWriter
from cosim.capture.camera_views import CAMERA, view_of_images
from cosim.capture.config import RunConfig
from cosim.capture.plan import EpisodePlan, plan_episodes, world_count
from cosim.capture.product_files import encode_products
from cosim.capture.products import cameras_of, wanted_of
from cosim.drives.kitti.calibration import format_calibration
from cosim.drives.kitti.labels import DONT_CARE, Labels, format_labels, parse_labels
from cosim.drives.kitti.oxts import Oxts, format_oxts
from cosim.drives.kitti.points import encode_points
from cosim.drives.kitti.rays import PointRays, encode_rays
from cosim.drives.twin import Camera, Ego, Instance, InstanceTexts, Lidar, TwinFrame, encode_glb, format_materials
from cosim.drives.writer import DriveWriter
from cosim.labels.effects import EXACT, relabelled
from cosim.labels.labelling import Labeller
from cosim.scene.bridge import Bridge
from cosim.scene.site import Land, Models, Site, light_of
from cosim.traffic.actors import Actors
from sensors.camera_view import CameraView
from sensors.cameras import KITTI_CALIBRATION, CameraRenderer, Light, kitti_cameras
from sensors.hits import Hits
from sensors.hits_file import encode_hits
from sensors.motion import EgoMotion
from sensors.point_cloud import PointCloud
from sensors.scene import Instances, Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from sumo_nets import Town

LABEL_DECIMALS = 4
_LABELLED = 2  # the camera that labels refer to
_RIG_STREAM = 2  # keeps the rig's random numbers apart from those of the measurement


class Recorder:
    """A sensor rig that goes from place to place and takes frame after frame.

    Args:
        config: of the run.
        sensor: the LiDAR.
        writer: of the drive.
        threads: threads it may use.
    """

    def __init__(self, config: RunConfig, sensor: SensorModel, writer: DriveWriter, *, threads: int = 1) -> None:
        self._config = config
        self._sensor = sensor
        self._writer = writer
        self._threads = threads
        self._behind = BackgroundWriter()  # waiting for the disk would cost as much again as a fast frame
        self._external = load_external(config.external_vehicles)
        self._meshes: dict[str, Mesh] = dict(self._external.meshes)
        self._models = Models(self._mesh)
        self._written_models: set[str] = set()
        self._instance_texts = InstanceTexts()
        self._worlds = world_count(plan_episodes(config))
        self._calibration = config.mounts.calibration
        rig = kitti_cameras(KITTI_CALIBRATION)
        needed = [*config.images, f"instance_{_LABELLED}"]
        if sensor.needs_camera:
            needed += [f"image_{CAMERA}", f"depth_{CAMERA}"]
        self._cameras = {number: rig[f"image_{number}"] for number in cameras_of(needed)}
        self._wanted = {number: wanted_of(number, needed) for number in self._cameras}
        self._tracer = Tracer(sensor.pattern.rays(), sensor.pattern.range_m)
        self._land: tuple[str, Land] | None = None
        self._place: Site | None = None
        self._renderer: CameraRenderer | None = None
        writer.write_once("twin/materials.yaml", format_materials(MATERIALS).encode())

    def move_to(self, plan: EpisodePlan) -> Town:
        """Make an episode's place ready in its light; gives its town. A place is not built twice in a row."""
        if self._land is None or self._land[0] != plan.town:
            self._land = plan.town, Land.of(plan.town)
        land = self._land[1]
        if self._place is None or (self._place.land, self._place.world) != (land, plan.world):
            self._place = None  # one world at a time fits into memory
            self._place = Site.build(self._config, land, plan.world, models=self._models, threads=self._threads)
            path = f"twin/{self._static_file() or 'static.glb'}"
            if not self._writer.has(path):
                self._writer.write(path, encode_glb(self._place.mesh, land.town.name))
        self._place.show(self._camera(), light_of(self._config, plan.number))
        self._labeller = Labeller(
            self._place.scene,
            self._calibration,
            range_m=self._config.label_range_m,
            min_pixels=self._config.min_label_pixels,
            min_points=self._config.min_label_points,
            annotators=self._config.annotators,
            seed=self._config.seed + plan.number,
        )
        self._bridge = Bridge(land.ground, self._config.seed + plan.number, self._external)
        return land.town

    def note(self, entry: dict[str, object]) -> None:
        """Write a remark about an episode into the manifest, behind its frames."""
        self._behind.settle()
        self._writer.write_note(entry)

    def record(self, name: str, plan: EpisodePlan, actors: Actors, ego: str) -> None:
        """Measure one instant and begin to write the frame.

        It is on disk when the next frame is taken, a remark is written or the recorder is closed, all of which raise
        what went wrong.
        """
        assert self._place is not None
        scene, renderer = self._place.scene, self._camera()
        placed = self._bridge.place(actors)
        row = actors.ids.index(ego)
        others = placed.take(np.delete(np.arange(len(placed)), row))
        ego_pose = placed.poses[row]
        jitter = np.random.default_rng([self._config.seed, int(name), _RIG_STREAM])
        lidar_pose_ego_now = self._config.rig_jitter.turned(self._config.mounts.lidar_pose, jitter)
        lidar_pose = ego_pose @ lidar_pose_ego_now
        camera_pose_ego = lidar_pose_ego_now @ self._calibration.rect_to_velo_matrix

        hits = self._tracer.trace(scene, lidar_pose, others)
        twin = self._twin(name, actors, row, others, ego_pose, lidar_pose_ego_now, camera_pose_ego)
        images = {
            number: renderer.render(ego_pose @ camera_pose_ego, camera.P, others, self._wanted[number])
            for number, camera in self._cameras.items()
        }
        view = None
        if self._sensor.needs_camera:
            view = view_of_images(images[CAMERA], self._cameras[CAMERA].P, ego_pose @ camera_pose_ego)
        cloud = self._measure(name, scene, hits, lidar_pose, others, twin.ego, view)
        exact = self._labeller.label(others, lidar_pose, images[_LABELLED].instance, _returns(hits, len(others)))
        exact_text = format_labels(exact, LABEL_DECIMALS)
        labels = exact
        if self._sensor.relabels:
            # From what is written, so that variants of the drive come to the same.
            written = parse_labels(exact_text)
            labels = relabelled(written, self._sensor, cloud.xyz, self._calibration, self._rng(name))

        oxts = self._config.navigation.measured(twin.ego, seed=self._config.seed, episode=plan.number, frame=int(name))
        files = self._files(name, cloud, labels, twin, oxts)
        files |= encode_products(self._config.images, images, others.kinds, name)
        if self._sensor.relabels:
            files[f"{EXACT}/{name}.txt"] = exact_text.encode()
        if self._config.store_hits:
            files[f"hits/{name}.npz"] = encode_hits(hits)
        self._write_models(others.models)
        write = partial(
            self._writer.write_frame,
            name,
            files,
            counts={
                "points": len(cloud),
                "instances": len(others),
                "labels": sum(kind != DONT_CARE for kind in labels.type),
            },
            episode=plan.number,
            town=self._place.land.town.name,
            time_s=round(actors.time_s, 6),
            ego=ego,
        )
        self._behind.do(write)

    def close(self) -> None:
        """Leave the place and free the renderer, and see the last frame written."""
        self._place = None
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        self._behind.settle()

    def _camera(self) -> CameraRenderer:
        """What draws all places of this rig; opened when first needed."""
        if self._renderer is None:
            camera = self._cameras[_LABELLED]
            self._renderer = CameraRenderer(
                Mesh.empty(),
                self._models.load,
                Light(),
                width=camera.width,
                height=camera.height,
                backend=self._config.backend,
                packed=self._models.packed,
            )
        return self._renderer

    def _static_file(self) -> str | None:
        """Where the twin keeps this place's world, relative to `twin/`, in a drive of several; else None."""
        assert self._place is not None
        return f"worlds/{self._place.land.town.name}-{self._place.world:03d}.glb" if self._worlds > 1 else None

    def _rng(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self._config.seed, int(name)])

    def _measure(
        self,
        name: str,
        scene: Scene,
        hits: Hits,
        lidar_pose: np.ndarray,
        others: Instances,
        ego: Ego,
        view: CameraView | None,
    ) -> PointCloud:
        rng = self._rng(name)
        if not self._sensor.needs_new_rays:
            return self._sensor.measure(hits, rng, view)
        motion = EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        return self._sensor.trace_and_measure(scene, lidar_pose, others, motion, rng, view)

    def _files(self, name: str, cloud: PointCloud, labels: Labels, twin: TwinFrame, oxts: Oxts) -> dict[str, bytes]:
        rays = PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no)
        return {
            f"velodyne/{name}.bin": encode_points(cloud.kitti),
            f"rays/{name}.npz": encode_rays(rays),
            f"calib/{name}.txt": format_calibration(self._calibration).encode(),
            f"label_2/{name}.txt": format_labels(labels, LABEL_DECIMALS).encode(),
            f"oxts/{name}.txt": format_oxts(oxts).encode(),
            f"twin/frames/{name}.json": twin.to_json(self._instance_texts).encode(),
        }

    def _twin(
        self,
        name: str,
        actors: Actors,
        row: int,
        others: Instances,
        ego_pose: np.ndarray,
        lidar_pose: np.ndarray,
        camera_pose: np.ndarray,
    ) -> TwinFrame:
        speed, turning = float(actors.speed_mps[row]), float(actors.yaw_rate_radps[row])
        forward, left = ego_pose[:3, 0], ego_pose[:3, 1]
        return TwinFrame(
            frame=name,
            time_s=actors.time_s,
            sweep_s=self._sensor.pattern.sweep_s,
            ego=Ego(
                pose=ego_pose,
                velocity_mps=speed * forward,
                yaw_rate_radps=turning,
                acceleration_mps2=float(actors.acceleration_mps2[row]) * forward + speed * turning * left,
            ),
            lidar=Lidar(lidar_pose, self._sensor.pattern.name),
            cameras={
                camera.name: Camera(camera_pose, camera.P, camera.width, camera.height)
                for camera in self._cameras.values()
            },
            instances=_twin_instances(others),
            static=self._static_file(),
        )

    def _mesh(self, name: str) -> Mesh:
        if name not in self._meshes:
            self._meshes[name] = build_model(name)
        return self._meshes[name]

    def _write_models(self, names: tuple[str, ...]) -> None:
        for name in sorted(set(names) - self._written_models):
            path = f"twin/models/{name}.glb"
            if not self._writer.has(path):
                self._writer.write(path, encode_glb(self._mesh(name), name))
            self._written_models.add(name)


def _returns(hits: Hits, instances: int) -> np.ndarray:
    """How many beams meet each instance, (n,)."""
    met = hits.solid.instance
    return np.bincount(met[met >= 0], minlength=instances)


def _twin_instances(instances: Instances) -> tuple[Instance, ...]:
    length, width, height = instances.sizes.T.tolist() if len(instances) else ((), (), ())
    columns = (
        instances.ids,
        instances.kinds,
        instances.models,
        instances.poses,
        instances.velocity_mps,
        instances.yaw_rate_radps.tolist(),
        length,
        width,
        height,
        instances.scales,
        instances.paint.tolist(),
    )
    return tuple(Instance(*values) for values in zip(*columns, strict=True))
