"""Measure the world at one instant with every sensor of the rig and write the frame in the background."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial

import numpy as np

from assets import MATERIALS, Mesh, build_model
from assets.external import load_external
from assets.ranges import draw
from cosim.capture.config import RunConfig
from cosim.capture.mast import Mast
from cosim.capture.placed_rig import place_rig
from cosim.capture.plan import EpisodePlan, plan_episodes, world_count
from cosim.capture.products import camera_of, kind_of
from cosim.capture.rig_cameras import RigCameras
from cosim.capture.rig_lidars import RigLidars
from cosim.capture.rig_sensors import measuring_rng
from cosim.drives.kitti.images import encode_depth, encode_gray, encode_instances, encode_rgb
from cosim.drives.kitti.labels import DONT_CARE, format_labels, parse_labels
from cosim.drives.kitti.oxts import format_oxts
from cosim.drives.twin import Ego, Instance, InstanceTexts, TwinFrame, encode_glb, format_materials
from cosim.drives.writer import DriveWriter
from cosim.engine.heap import return_free_blocks
from cosim.labels.effects import EXACT, relabelled
from cosim.labels.labelling import Labeller
from cosim.scene.bridge import Bridge
from cosim.scene.lamps import base_of, glowing_mesh, signal_models, with_lamps, with_signals
from cosim.scene.seated import seat_persons
from cosim.scene.site import Land, Models, Site, light_of
from cosim.scene.surroundings import SIGHT_M, is_large, surroundings
from cosim.traffic.actors import Actors
from sensors.cameras import Images, semantic_image
from sensors.scene import Instances
from sensors.sensor_model import SensorModel
from sumo_nets import Town, read_town

LABEL_DECIMALS = 4
_RIG_STREAM = 2  # random stream of the rig jitter, independent of the measurement
_SEATED_STREAM = 6
_LABELS = "label_2"
_WORLD_MATERIALS = tuple(name for name, material in MATERIALS.items() if not material.glow)
_IMAGE_ENCODERS: Mapping[str, Callable[[Images, tuple[str, ...]], bytes]] = {
    "gray": lambda images, _: encode_gray(images.gray),
    "image": lambda images, _: encode_rgb(images.rgb),
    "depth": lambda images, _: encode_depth(images.depth_m),
    "semantic": lambda images, kinds: encode_gray(semantic_image(images, kinds)),
    "instance": lambda images, _: encode_instances(images.instance),
}


class Recorder:
    """Records frames with a sensor rig at changing sites.

    Args:
        config: configuration of the run.
        sensors: sensor models of the LiDARs by name, the first LiDAR first.
        writer: writer of the drive.
        threads: number of threads to use.
    """

    def __init__(
        self, config: RunConfig, sensors: Mapping[str, SensorModel], writer: DriveWriter, *, threads: int = 1
    ) -> None:
        self._config = config
        self._writer = writer
        self._threads = threads
        self._background = BackgroundWriter()  # waiting for the disk takes as long as computing a small frame
        self._external = load_external(config.external_vehicles)
        self._meshes: dict[str, Mesh] = {**self._external.meshes, **signal_models()}
        self._models = Models(self._mesh)
        self._written_models: set[str] = set()
        self._instance_texts = InstanceTexts()
        plans = plan_episodes(config)
        self._worlds, self._episodes = world_count(plans), len(plans)
        self._static: str | None = None
        self._rig = place_rig(config)
        self._sensor = sensors[self._rig.first]
        self._lidars = RigLidars(self._rig, sensors, config.seed)
        needs_view = any(sensor.needs_camera for sensor in sensors.values())
        self._cameras = RigCameras(
            self._rig,
            config.images,
            self._models,
            config.backend,
            sensor=self._sensor,
            needs_view=needs_view,
            seed=config.seed,
        )
        self._town: tuple[str, Town] | None = None
        self._land: Land | None = None
        self._site: Site | None = None
        self._bridge: Bridge | None = None
        self._labellers: dict[str, Labeller] = {}
        reach_m = max(sensor.pattern.range_m[1] for sensor in sensors.values())
        self._sight_m = max(reach_m, config.label_range_m, SIGHT_M if config.images or needs_view else 0.0)
        writer.write_once("twin/materials.yaml", format_materials(_WORLD_MATERIALS).encode())

    def move_to(self, plan: EpisodePlan) -> Town:
        """Prepare the site and the light of an episode; the current site is reused. Returns the episode's town.

        The site of a large town depends on the route; `move_along` prepares it.
        """
        if self._town is None or self._town[0] != plan.town:
            self._leave()  # free its memory before the next town is read
            self._land = None
            self._town = plan.town, read_town(plan.town)
        town = self._town[1]
        if not self.follows_route:
            if self._land is None:
                self._land = Land(town, town.streets)
            if self._site is None or self._site.world != plan.world:
                self._build(self._land, plan, f"worlds/{town.name}-{plan.world:03d}.glb" if self._worlds > 1 else None)
            self._enter(plan)
        return town

    @property
    def follows_route(self) -> bool:
        """Whether the current town is so large that only the surroundings of each route are built."""
        return self._town is not None and self._config.world is None and is_large(self._town[1].streets)

    def move_along(self, plan: EpisodePlan, attempt: int, route: np.ndarray) -> None:
        """Prepare the site of a simulation in a large town: the surroundings of its route.

        Args:
            plan: plan of the episode.
            attempt: number of the simulation in its episode.
            route: (n, 2) positions of the sensors' carrier [m].
        """
        assert self._town is not None
        town, is_only = self._town[1], self._episodes == 1 and attempt == 0
        self._land = None
        land = Land(town, surroundings(town.streets, route, self._sight_m))
        self._build(land, plan, None if is_only else f"worlds/{town.name}-{plan.number:04d}-{attempt}.glb")
        self._enter(plan)

    def _build(self, land: Land, plan: EpisodePlan, static: str | None) -> None:
        """Build the static world; `static` is its file relative to `twin/` if the drive has several, else None."""
        self._leave()  # free its memory before the next world is built
        self._site = Site.build(self._config, land, plan.world, models=self._models, threads=self._threads)
        self._static = static
        path = f"twin/{static or 'static.glb'}"
        if not self._writer.has(path):
            self._writer.write(path, encode_glb(self._site.mesh, land.town.name))
        return_free_blocks()

    def _leave(self) -> None:
        """Release the current site and everything that refers to it."""
        self._site = self._bridge = None
        self._labellers = {}
        self._cameras.leave()
        return_free_blocks()

    def _enter(self, plan: EpisodePlan) -> None:
        """Load the current site and the light of an episode."""
        assert self._site is not None
        self._cameras.enter(self._site, light_of(self._config, plan.number))
        self._labellers = {name: self._make_labeller(name, plan.number) for name in self._cameras.labelled}
        self._bridge = Bridge(self._site.ground, self._config.seed + plan.number, self._external)
        self._seated = seat_persons(self._site.seats, *self._seated_share(plan.number))

    def _seated_share(self, episode: int) -> tuple[float, int]:
        """Share of the seats that are taken in an episode, and the seed of who sits; 0 in a user's own scenario."""
        assert self._town is not None
        rng = np.random.default_rng([self._config.seed, episode, 0, _SEATED_STREAM])
        share, seed = draw(self._config.population.sitting, rng), int(rng.integers(2**31))
        is_simulated = self._town[1].is_built_in and self._config.trajectories is None
        return share if is_simulated else 0.0, seed

    def note(self, entry: dict[str, object]) -> None:
        """Write an entry about an episode into the manifest, after its frames."""
        self._background.wait()
        self._writer.write_note(entry)

    def record(
        self, name: str, plan: EpisodePlan, actors: Actors, carrier: str | Mast, signals: Mapping[str, str]
    ) -> None:
        """Measure one instant from a vehicle (given by its id) or a mast, and start to write the frame.

        The frame is written in the background. The next call of `record`, `note` or `close` waits until it is on disk
        and re-raises an error of the writer.

        Args:
            name: name of the frame.
            plan: plan of the episode.
            actors: road users at this instant.
            carrier: carrier of the sensors.
            signals: SUMO's state letter of every lane with a traffic signal.
        """
        assert self._site is not None and self._bridge is not None
        instances = self._bridge.place(actors)
        if isinstance(carrier, Mast):
            ego, others, bits = carrier.ego(self._site.ground), instances, actors.signals
        else:
            row = actors.ids.index(carrier)
            rest = np.delete(np.arange(len(instances)), row)
            ego, others, bits = _ego(actors, row, instances.poses[row]), instances.take(rest), actors.signals[rest]
        others, bits = self._with_seated(others, bits, ego.pose[:3, 3])
        jitter = np.random.default_rng([self._config.seed, int(name), _RIG_STREAM])
        lidar_pose_ego = self._config.rig_jitter.apply(self._rig.lidar_pose, jitter)

        with_lights = with_lamps(others, bits, actors.time_s)
        with_lights = with_signals(with_lights, self._site.signals, signals, ego.pose[:3, 3], actors.time_s)
        rendered = self._cameras.render(name, ego.pose, lidar_pose_ego, others, with_lights)
        scans = self._lidars.scan(name, self._site.scene, lidar_pose_ego, others, ego, rendered.view, actors.time_s)
        returns = self._lidars.returns(scans, len(others))
        exact = {
            camera: labeller.label(
                others, ego.pose @ lidar_pose_ego @ self._rig.level, rendered.undistorted[camera].instance, returns
            )
            for camera, labeller in self._labellers.items()
        }
        exact_text = format_labels(exact[self._rig.reference], LABEL_DECIMALS)
        labels = exact[self._rig.reference]
        cloud = scans[self._rig.first].cloud
        if self._sensor.relabels:
            # Start from the text of the exact labels, so that variants of the drive get the same result.
            written, rng = parse_labels(exact_text), measuring_rng(self._config.seed, name)
            labels = relabelled(written, self._sensor, cloud.xyz, self._rig.calibrations[self._rig.first], rng)

        twin = self._twin(name, actors.time_s, ego, others, lidar_pose_ego)
        oxts = self._config.navigation.measured(ego, seed=self._config.seed, episode=plan.number, frame=int(name))
        files = self._lidars.files(name, scans)
        files[f"{_LABELS}/{name}.txt"] = format_labels(labels, LABEL_DECIMALS).encode()
        files[f"oxts/{name}.txt"] = format_oxts(oxts).encode()
        files[f"twin/frames/{name}.json"] = twin.to_json(self._instance_texts).encode()
        for camera, camera_labels in exact.items():
            if camera != self._rig.reference:
                files[f"label_{camera}/{name}.txt"] = format_labels(camera_labels, LABEL_DECIMALS).encode()
        gray = {name for name, camera in self._cameras.used.items() if camera.kind == "gray"}
        files |= _encode_products(self._config.images, rendered.images, gray, others.kinds, name)
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
            town=self._site.land.town.name,
            time_s=round(actors.time_s, 6),
            ego=carrier if isinstance(carrier, str) else "mast",
        )
        self._background.do(write)

    def _with_seated(self, others: Instances, bits: np.ndarray, position: np.ndarray) -> tuple[Instances, np.ndarray]:
        """Append the persons that sit within sight of a position (3,) to the instances and their signal bits."""
        away = self._seated.poses[:, :3, 3] - position
        near = np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) < self._sight_m)
        if not len(near):
            return others, bits
        return others.and_then(self._seated.take(near)), np.concatenate([bits, np.zeros(len(near), bits.dtype)])

    def close(self) -> None:
        """Free the site and the renderers, and wait until the last frame is written."""
        self._site = None
        self._cameras.close()
        self._background.wait()

    def _make_labeller(self, camera: str, episode: int) -> Labeller:
        calibration = self._rig.cameras[camera].calibration
        assert self._site is not None and calibration is not None  # true for every labelled camera
        return Labeller(
            self._site.scene,
            calibration,
            range_m=self._config.label_range_m,
            min_pixels=self._config.min_label_pixels,
            min_points=self._config.min_label_points,
            annotators=self._config.annotators,
            seed=self._config.seed + episode,
        )

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
            static=self._static,
            lidars=lidars,
        )

    def _mesh(self, name: str) -> Mesh:
        if name not in self._meshes:
            base, lamps = base_of(name)
            self._meshes[name] = glowing_mesh(self._mesh(base), lamps) if lamps else build_model(name)
        return self._meshes[name]

    def _write_models(self, names: tuple[str, ...]) -> None:
        for name in sorted(set(names) - self._written_models):
            path = f"twin/models/{name}.glb"
            if not self._writer.has(path):
                self._writer.write(path, encode_glb(self._mesh(name), name))
            self._written_models.add(name)


class BackgroundWriter:
    """Runs tasks in one background thread, in the order of submission."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._last: Future[None] | None = None

    def do(self, work: Callable[[], None]) -> None:
        """Wait for the previous task, then start this one; re-raises an exception of the previous task."""
        self.wait()
        self._last = self._thread.submit(work)

    def wait(self) -> None:
        """Wait until the last task is done; re-raises its exception once."""
        last, self._last = self._last, None
        if last is not None:
            last.result()


def _ego(actors: Actors, row: int, pose: np.ndarray) -> Ego:
    """Pose and motion of the vehicle that carries the sensors."""
    speed, yaw_rate = float(actors.speed_mps[row]), float(actors.yaw_rate_radps[row])
    forward, left = pose[:3, 0], pose[:3, 1]
    return Ego(
        pose=pose,
        velocity_mps=speed * forward,
        yaw_rate_radps=yaw_rate,
        acceleration_mps2=float(actors.acceleration_mps2[row]) * forward + speed * yaw_rate * left,
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


def _encode_products(
    products: Sequence[str], images: Mapping[str, Images], gray: Collection[str], types: tuple[str, ...], name: str
) -> dict[str, bytes]:
    """Encode the images of a frame; returns file contents by path.

    Args:
        products: names of the image folders.
        images: images by camera.
        gray: names of the grayscale cameras.
        types: kinds of the instances in the images.
        name: name of the frame.
    """
    files = {}
    for product in products:
        kind, camera = kind_of(product), camera_of(product)
        encode = _IMAGE_ENCODERS["gray" if kind == "image" and camera in gray else kind]
        files[f"{product}/{name}.png"] = encode(images[camera], types)
    return files
