"""Measures the world at one instant with every sensor of the rig and writes the frame."""

from __future__ import annotations

import numpy as np

from assets import MATERIALS, Mesh, build_model
from assets.external import load_external
from assets.world import build_world
from cosim.actors import Actors
from cosim.bridge import Bridge
from cosim.config import RunConfig
from cosim.drive_writer import DriveWriter
from cosim.ground import Ground
from cosim.kitti.calibration import Calibration, format_calibration
from cosim.kitti.images import encode_depth, encode_gray, encode_rgb
from cosim.kitti.labels import DONT_CARE, Labels, format_labels
from cosim.kitti.oxts import Oxts, format_oxts
from cosim.kitti.points import encode_points
from cosim.kitti.rays import PointRays, encode_rays
from cosim.labelling import Labeller
from cosim.twin import Camera, Ego, Instance, Lidar, TwinFrame, encode_glb, format_materials
from sensors.cameras import KITTI_CALIBRATION, CameraRenderer, Images, Light, bake_sun_shadows, kitti_cameras
from sensors.cameras.kitti_rig import lidar_pose_ego
from sensors.hits import Hits
from sensors.hits_file import encode_hits
from sensors.motion import EgoMotion
from sensors.point_cloud import PointCloud
from sensors.scene import Instances, Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from sumo_nets import Town

LABEL_DECIMALS = 4
_CAMERAS = ("image_0", "image_2")  # gray and depth; colour, and the camera that labels refer to
_LIGHT_STREAM = 1  # keeps the light's random numbers apart from those of worlds and episodes


class Recorder:
    """A rig in a town: built once a process, then asked for frame after frame.

    Args:
        config: of the run.
        town: where.
        sensor: the LiDAR.
        writer: of the drive.
        threads: threads it may use.
    """

    def __init__(
        self, config: RunConfig, town: Town, sensor: SensorModel, writer: DriveWriter, *, threads: int = 1
    ) -> None:
        self._config = config
        self._sensor = sensor
        self._writer = writer
        external = load_external(config.external_vehicles)
        self._models: dict[str, Mesh] = dict(external.meshes)
        self._written_models: set[str] = set()

        world = build_world(town.streets, config.seed)
        light = draw_light(np.random.default_rng([config.seed, _LIGHT_STREAM]))
        self._calibration = Calibration(**vars(KITTI_CALIBRATION))
        self._lidar_pose_ego = lidar_pose_ego()
        self._cameras = {name: camera for name, camera in kitti_cameras(KITTI_CALIBRATION).items() if name in _CAMERAS}
        self._bridge = Bridge(Ground(world.ground), config.seed, external)
        self._scene = Scene(world.mesh, self._model, threads)
        self._tracer = Tracer(sensor.pattern.rays(), sensor.pattern.range_m)
        self._labeller = Labeller(
            self._scene, self._calibration, range_m=config.label_range_m, min_pixels=config.min_label_pixels
        )
        self._renderer = CameraRenderer(
            world.mesh,
            self._model,
            light,
            width=self._cameras["image_0"].width,
            height=self._cameras["image_0"].height,
            backend=config.backend,
            static_shade=bake_sun_shadows(world.mesh, light, self._scene.static),
        )
        if not writer.has("twin/static.glb"):
            writer.write("twin/static.glb", encode_glb(world.mesh, town.name))
        writer.write_once("twin/materials.yaml", format_materials(MATERIALS).encode())

    def record(self, name: str, episode: int, actors: Actors, ego: str) -> None:
        """Measure one instant and write the frame."""
        placed = self._bridge.place(actors)
        row = actors.ids.index(ego)
        others = placed.take(np.delete(np.arange(len(placed)), row))
        ego_pose = placed.poses[row]
        lidar_pose = ego_pose @ self._lidar_pose_ego

        hits = self._tracer.trace(self._scene, lidar_pose, others)
        twin = self._twin(name, actors, row, others, ego_pose)
        cloud = self._measure(name, hits, lidar_pose, others, twin.ego)
        left, colour = (
            self._renderer.render(ego_pose @ camera.pose, camera.P, others) for camera in self._cameras.values()
        )
        labels = self._labeller.label(others, lidar_pose, colour.instance)

        oxts = Oxts.from_motion(ego_pose, twin.ego.velocity_mps, twin.ego.yaw_rate_radps, twin.ego.acceleration_mps2)
        files = self._files(name, cloud, left, colour, labels, twin, oxts)
        if self._config.store_hits:
            files[f"hits/{name}.npz"] = encode_hits(hits)
        self._write_models(others.models)
        self._writer.write_frame(
            name,
            files,
            counts={
                "points": len(cloud),
                "instances": len(others),
                "labels": sum(kind != DONT_CARE for kind in labels.type),
            },
            episode=episode,
            time_s=round(actors.time_s, 6),
            ego=ego,
        )

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def _measure(self, name: str, hits: Hits, lidar_pose: np.ndarray, others: Instances, ego: Ego) -> PointCloud:
        rng = np.random.default_rng([self._config.seed, int(name)])
        if not self._sensor.needs_new_rays:
            return self._sensor.measure(hits, rng)
        motion = EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        return self._sensor.trace_and_measure(self._scene, lidar_pose, others, motion, rng)

    def _files(
        self, name: str, cloud: PointCloud, left: Images, colour: Images, labels: Labels, twin: TwinFrame, oxts: Oxts
    ) -> dict[str, bytes]:
        rays = PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no)
        files = {
            f"velodyne/{name}.bin": encode_points(cloud.kitti),
            f"rays/{name}.npz": encode_rays(rays),
            f"image_0/{name}.png": encode_gray(left.gray),
            f"depth_0/{name}.png": encode_depth(left.depth_m),
            f"calib/{name}.txt": format_calibration(self._calibration).encode(),
            f"label_2/{name}.txt": format_labels(labels, LABEL_DECIMALS).encode(),
            f"oxts/{name}.txt": format_oxts(oxts).encode(),
            f"twin/frames/{name}.json": twin.to_json().encode(),
        }
        if self._config.colour_image:
            files[f"image_2/{name}.png"] = encode_rgb(colour.rgb)
        return files

    def _twin(self, name: str, actors: Actors, row: int, others: Instances, ego_pose: np.ndarray) -> TwinFrame:
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
            lidar=Lidar(self._lidar_pose_ego, self._sensor.pattern.name),
            cameras={
                name: Camera(camera.pose, camera.P, camera.width, camera.height)
                for name, camera in self._cameras.items()
            },
            instances=_twin_instances(others),
        )

    def _model(self, name: str) -> Mesh:
        if name not in self._models:
            self._models[name] = build_model(name)
        return self._models[name]

    def _write_models(self, names: tuple[str, ...]) -> None:
        for name in sorted(set(names) - self._written_models):
            path = f"twin/models/{name}.glb"
            if not self._writer.has(path):
                self._writer.write(path, encode_glb(self._model(name), name))
            self._written_models.add(name)


def draw_light(rng: np.random.Generator) -> Light:
    """Sun of a random hour."""
    return Light(
        sun_elevation_deg=float(rng.uniform(22, 60)),
        sun_azimuth_deg=float(rng.uniform(-180, 180)),
    )


def _twin_instances(instances: Instances) -> tuple[Instance, ...]:
    return tuple(
        Instance(
            id=instances.ids[row],
            kind=instances.kinds[row],
            model=instances.models[row],
            pose=instances.poses[row],
            velocity_mps=instances.velocity_mps[row],
            yaw_rate_radps=float(instances.yaw_rate_radps[row]),
            length_m=float(instances.sizes[row, 0]),
            width_m=float(instances.sizes[row, 1]),
            height_m=float(instances.sizes[row, 2]),
            scale=instances.scales[row],
            paint=float(instances.paint[row]),
        )
        for row in range(len(instances))
    )
