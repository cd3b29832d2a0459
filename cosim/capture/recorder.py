"""Measures the world at one instant with every sensor of the rig and writes the frame."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from assets import MATERIALS, Mesh, build_model
from assets.external import load_external
from cosim.capture.background import BackgroundWriter
from cosim.capture.config import RunConfig
from cosim.capture.mast import Mast
from cosim.capture.placed_rig import place_rig
from cosim.capture.plan import EpisodePlan, plan_episodes, world_count
from cosim.capture.product_files import encode_products
from cosim.capture.rig_cameras import RigCameras
from cosim.capture.rig_lidars import RigLidars
from cosim.capture.rig_sensors import measuring_rng
from cosim.drives.kitti.labels import DONT_CARE, format_labels, parse_labels
from cosim.drives.kitti.oxts import format_oxts
from cosim.drives.twin import Ego, Instance, InstanceTexts, TwinFrame, encode_glb, format_materials
from cosim.drives.writer import DriveWriter
from cosim.labels.effects import EXACT, relabelled
from cosim.labels.labelling import Labeller
from cosim.scene.bridge import Bridge
from cosim.scene.ground import Ground
from cosim.scene.lamps import base_of, lit_mesh, signal_models, with_lamps, with_signals
from cosim.scene.site import Land, Models, Site, light_of
from cosim.traffic.actors import Actors
from sensors.scene import Instances
from sensors.sensor_model import SensorModel
from sumo_nets import Town

LABEL_DECIMALS = 4
_RIG_STREAM = 2  # keeps the rig's random numbers apart from those of the measurement
_LABELS = "label_2"
_OF_WORLDS = tuple(name for name, material in MATERIALS.items() if not material.glow)


class Recorder:
    """A sensor rig that goes from place to place and takes frame after frame.

    Args:
        config: of the run.
        sensors: of its LiDARs, by name, the first one first.
        writer: of the drive.
        threads: threads it may use.
    """

    def __init__(
        self, config: RunConfig, sensors: Mapping[str, SensorModel], writer: DriveWriter, *, threads: int = 1
    ) -> None:
        self._config = config
        self._writer = writer
        self._threads = threads
        self._behind = BackgroundWriter()  # waiting for the disk would cost as much again as a fast frame
        self._external = load_external(config.external_vehicles)
        self._meshes: dict[str, Mesh] = {**self._external.meshes, **signal_models()}
        self._models = Models(self._mesh)
        self._written_models: set[str] = set()
        self._instance_texts = InstanceTexts()
        self._worlds = world_count(plan_episodes(config))
        self._rig = place_rig(config)
        self._sensor = sensors[self._rig.first]
        self._lidars = RigLidars(self._rig, sensors, config.seed)
        lit = any(sensor.needs_camera for sensor in sensors.values())
        self._cameras = RigCameras(self._rig, config.images, self._models, config.backend, lit=lit, seed=config.seed)
        self._land: tuple[str, Land] | None = None
        self._place: Site | None = None
        writer.write_once("twin/materials.yaml", format_materials(_OF_WORLDS).encode())

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
        self._cameras.enter(self._place, light_of(self._config, plan.number))
        self._labellers = {name: self._labeller(name, plan.number) for name in self._cameras.labelled}
        self._ground = land.ground if self._config.world is None else Ground(self._place.mesh)
        self._bridge = Bridge(self._ground, self._config.seed + plan.number, self._external)
        return land.town

    def note(self, entry: dict[str, object]) -> None:
        """Write a remark about an episode into the manifest, behind its frames."""
        self._behind.settle()
        self._writer.write_note(entry)

    def record(
        self, name: str, plan: EpisodePlan, actors: Actors, carrier: str | Mast, signals: Mapping[str, str]
    ) -> None:
        """Measure one instant, from a vehicle by its id or from a mast, and begin to write the frame.

        `signals` holds SUMO's letter for every lane with a traffic signal.
        It is on disk when the next frame is taken, a remark is written or the recorder is closed, all of which raise
        what went wrong.
        """
        assert self._place is not None
        placed = self._bridge.place(actors)
        if isinstance(carrier, Mast):
            ego, others, bits = carrier.ego(self._ground), placed, actors.signals
        else:
            row = actors.ids.index(carrier)
            rest = np.delete(np.arange(len(placed)), row)
            ego, others, bits = _ego(actors, row, placed.poses[row]), placed.take(rest), actors.signals[rest]
        jitter = np.random.default_rng([self._config.seed, int(name), _RIG_STREAM])
        lidar_pose_ego = self._config.rig_jitter.turned(self._rig.lidar_pose, jitter)

        lit = with_lamps(others, bits, actors.time_s)
        lit = with_signals(lit, self._place.signals, signals, ego.pose[:3, 3], actors.time_s)
        seen = self._cameras.look(name, ego.pose, lidar_pose_ego, others, lit)
        scans = self._lidars.scan(name, self._place.scene, lidar_pose_ego, others, ego, seen.view, actors.time_s)
        returns = self._lidars.returns(scans, len(others))
        exact = {
            camera: labeller.label(
                others, ego.pose @ lidar_pose_ego @ self._rig.level, seen.straight[camera].instance, returns
            )
            for camera, labeller in self._labellers.items()
        }
        exact_text = format_labels(exact[self._rig.reference], LABEL_DECIMALS)
        labels = exact[self._rig.reference]
        cloud = scans[self._rig.first].cloud
        if self._sensor.relabels:
            # From what is written, so that variants of the drive come to the same.
            written, rng = parse_labels(exact_text), measuring_rng(self._config.seed, name)
            labels = relabelled(written, self._sensor, cloud.xyz, self._rig.calibrations[self._rig.first], rng)

        twin = self._twin(name, actors.time_s, ego, others, lidar_pose_ego)
        oxts = self._config.navigation.measured(ego, seed=self._config.seed, episode=plan.number, frame=int(name))
        files = self._lidars.files(name, scans)
        files[f"{_LABELS}/{name}.txt"] = format_labels(labels, LABEL_DECIMALS).encode()
        files[f"oxts/{name}.txt"] = format_oxts(oxts).encode()
        files[f"twin/frames/{name}.json"] = twin.to_json(self._instance_texts).encode()
        for camera, found in exact.items():
            if camera != self._rig.reference:
                files[f"label_{camera}/{name}.txt"] = format_labels(found, LABEL_DECIMALS).encode()
        gray = {camera for camera, one in self._cameras.used.items() if one.kind == "gray"}
        files |= encode_products(self._config.images, seen.images, gray, others.kinds, name)
        if self._sensor.relabels:
            files[f"{EXACT}/{name}.txt"] = exact_text.encode()
        if self._config.store_hits:
            files |= self._lidars.hit_files(name, scans)
        self._write_models(others.models)
        write = partial(
            self._writer.write_frame,
            name,
            files,
            counts={
                "points": sum(len(scan.cloud) for scan in scans.values()),
                "instances": len(others),
                "labels": sum(kind != DONT_CARE for kind in labels.type),
            },
            episode=plan.number,
            town=self._place.land.town.name,
            time_s=round(actors.time_s, 6),
            ego=carrier if isinstance(carrier, str) else "mast",
        )
        self._behind.do(write)

    def close(self) -> None:
        """Leave the place and free the renderer, and see the last frame written."""
        self._place = None
        self._cameras.close()
        self._behind.settle()

    def _labeller(self, camera: str, episode: int) -> Labeller:
        calibration = self._rig.cameras[camera].calibration
        assert self._place is not None and calibration is not None  # of those that labels are drawn in
        return Labeller(
            self._place.scene,
            calibration,
            range_m=self._config.label_range_m,
            min_pixels=self._config.min_label_pixels,
            min_points=self._config.min_label_points,
            annotators=self._config.annotators,
            seed=self._config.seed + episode,
        )

    def _static_file(self) -> str | None:
        """Where the twin keeps this place's world, relative to `twin/`, in a drive of several; else None."""
        assert self._place is not None
        return f"worlds/{self._place.land.town.name}-{self._place.world:03d}.glb" if self._worlds > 1 else None

    def _twin(self, name: str, time_s: float, ego: Ego, others: Instances, lidar_pose_ego: np.ndarray) -> TwinFrame:
        lidars = self._lidars.twins(lidar_pose_ego, named=not self._config.rig_used.kitti_row)
        return TwinFrame(
            frame=name,
            time_s=time_s,
            sweep_s=self._sensor.pattern.sweep_s,
            ego=ego,
            lidar=lidars.pop(self._rig.first),
            cameras=self._cameras.twins(lidar_pose_ego),
            instances=_twin_instances(others),
            static=self._static_file(),
            lidars=lidars,
        )

    def _mesh(self, name: str) -> Mesh:
        if name not in self._meshes:
            base, lamps = base_of(name)
            self._meshes[name] = lit_mesh(self._mesh(base), lamps) if lamps else build_model(name)
        return self._meshes[name]

    def _write_models(self, names: tuple[str, ...]) -> None:
        for name in sorted(set(names) - self._written_models):
            path = f"twin/models/{name}.glb"
            if not self._writer.has(path):
                self._writer.write(path, encode_glb(self._mesh(name), name))
            self._written_models.add(name)


def _ego(actors: Actors, row: int, pose: np.ndarray) -> Ego:
    """The vehicle that carries the sensors, and its motion."""
    speed, turning = float(actors.speed_mps[row]), float(actors.yaw_rate_radps[row])
    forward, left = pose[:3, 0], pose[:3, 1]
    return Ego(
        pose=pose,
        velocity_mps=speed * forward,
        yaw_rate_radps=turning,
        acceleration_mps2=float(actors.acceleration_mps2[row]) * forward + speed * turning * left,
    )


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
