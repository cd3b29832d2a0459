"""Frames of a town in traffic, for benchmarks of single stages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from assets import Mesh, build_model
from assets.world.build import build_world
from cosim.scene.bridge import Bridge
from cosim.scene.ground import Ground
from cosim.traffic.ego import draw_ego
from cosim.traffic.simulation import Traffic
from sensors.cameras.kitti_rig import lidar_pose_ego
from sensors.motion import EgoMotion
from sensors.scene import Instances, Scene
from sumo_nets import read_town


@dataclass(frozen=True, eq=False)
class Shown:
    """One instant.

    Attributes:
        scene: its queries run in one thread.
        shared: the same, its large queries shared among the processor's cores.
        world: the static mesh.
        pose: (4, 4) of the LiDAR.
        others: what moves.
        ego: the vehicle that carries the LiDAR.
    """

    scene: Scene
    shared: Scene
    world: Mesh
    pose: np.ndarray
    others: Instances
    ego: EgoMotion

    @property
    def merged(self) -> Mesh:
        """The world with all that moves frozen into one mesh."""
        models = {name: build_model(name) for name in set(self.others.models)}
        placed = self.others.poses.copy()
        placed[:, :3, :3] *= self.others.scales[:, None, :]
        parts = [models[name].transformed(pose) for name, pose in zip(self.others.models, placed, strict=True)]
        return Mesh.merge([self.world, *parts])

    def nearest(self, count: int) -> Instances:
        """The instances nearest to the LiDAR."""
        distance = np.linalg.norm(self.others.poses[:, :3, 3] - self.pose[:3, 3], axis=1)
        return self.others.take(np.argsort(distance, kind="stable")[:count])


def shown_frames(count: int, threads: int) -> Iterator[Shown]:
    """Some frames of town01, five seconds apart."""
    town = read_town("town01")
    world = build_world(town.streets, 1)
    scene, shared = (Scene(world.mesh, build_model, number) for number in (1, threads))
    bridge = Bridge(Ground(world.ground), 1)
    rng = np.random.default_rng(1)
    with Traffic(town.sumocfg, seed=1) as traffic:
        ego = draw_ego(traffic, traffic.advance(600), rng)
        for _ in range(count):
            traffic.prolong_route(ego, rng)
            actors = traffic.advance(50)
            placed = bridge.place(actors)
            row = actors.ids.index(ego)
            others = placed.take(np.delete(np.arange(len(placed)), row))
            motion = EgoMotion(
                placed.poses[row], placed.velocity_mps[row], float(placed.yaw_rate_radps[row]), np.zeros(3)
            )
            yield Shown(scene, shared, world.mesh, placed.poses[row] @ lidar_pose_ego(), others, motion)


def embree_scene(mesh: Mesh) -> EmbreeScene:
    """A mesh traced by Embree only."""
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, mesh.vertices, mesh.faces)
    return scene
