"""Poses of scans, refined on the planes that their points lie on.

A single scan is registered by point-to-plane matching (Chen and Medioni, Image Vis. Comput. 10, 1992). All scans
together are adjusted with the surfels' positions along their normals as unknowns, eliminated surfel by surfel, as
a bundle adjustment does with points (Triggs et al., Bundle adjustment: a modern synthesis, 2000; for planes Liu and
Zhang, BALM, RA-L 6, 2021): where every scan is placed by itself, a map that drifts only follows the scans that made it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg, sparse

from cosim.drives.twin.surfels import cell_keys
from cosim.recordings.mapping.motion import applied, nudged
from cosim.recordings.mapping.scans import LocalScan, cloud_of
from cosim.recordings.mapping.surfels import Surfels, SurfelSettings, make_surfels

OUTLIER_M = 0.15  # a point farther off a surfel is of something else
_HUBER_M = 0.03
_PRIOR = np.array([1e3, 1e3, 1e3, 1e2, 1e2, 1e2])  # holds what no surface holds
_FEWEST = 50
_CHUNK = 4096  # surfels that are eliminated at a time
_HELD = 1e12  # information that the first scan stays where it is
_LEAST_TOLD = 1e-3  # information that points are freed of as much motion as they are
_WINDOW, _RENEWED, _THIN = 12, 2, 0.5  # scans of a local map, scans that share one, and of their points which share
_LOCAL = {"cell_m": 0.8, "least_points": 10, "least_scans": 1}


@dataclass(frozen=True, eq=False)
class _Match:
    """Points of a scan on surfels: which, rows of surfels, weights, distances, slopes by turn and shift of the pose."""

    point: np.ndarray
    row: np.ndarray
    weight: np.ndarray
    off: np.ndarray
    slope: np.ndarray


def _matched(xyz: np.ndarray, pose: np.ndarray, surfels: Surfels, cell_m: float) -> _Match:
    world = applied(pose, xyz)
    row = surfels.rows_of(cell_keys(world, cell_m))
    on = np.flatnonzero(row >= 0)
    row, world = row[on], world[on]
    normal = surfels.normal[row]
    off = np.einsum("ij,ij->i", world - surfels.centre[row], normal)
    near = np.abs(off) < OUTLIER_M
    on, row, world, normal, off = on[near], row[near], world[near], normal[near], off[near]
    weight = np.minimum(1.0, _HUBER_M / np.maximum(np.abs(off), 1e-9))
    return _Match(on, row, weight, off, np.concatenate([np.cross(world - pose[:3, 3], normal), normal], 1))


def place(xyz: np.ndarray, pose: np.ndarray, surfels: Surfels, cell_m: float, rounds: int) -> np.ndarray:
    """A scan's pose (4, 4) that brings its points (n, 3) best onto the surfels: point to plane, Huber's weights."""
    for _ in range(rounds):
        met = _matched(xyz, pose, surfels, cell_m)
        if len(met.row) < _FEWEST:
            return pose
        weighted = met.slope * met.weight[:, None]
        pose = nudged(pose, np.linalg.solve(weighted.T @ met.slope + np.diag(_PRIOR), -weighted.T @ met.off))
    return pose


def placed_in_turn(
    scans: Sequence[LocalScan], poses: np.ndarray, motion: np.ndarray, numbers: Sequence[int]
) -> np.ndarray:
    """Poses (n, 4, 4) of scans placed one after the other on the surfels of those before, ground and all.

    Args:
        scans: all of them.
        poses: (n, 4, 4) whose steps lead from scan to scan.
        motion: (n, 6) of the sensor in a sweep.
        numbers: scans that make local maps; the others are placed on these, too.
    """
    found, settings = poses.copy(), replace(SurfelSettings(), **_LOCAL)
    thin = [scan.thinned(_THIN) for scan in scans]
    known: list[int] = []
    surfels, since = None, 0
    for number in range(len(scans)):
        if number:
            found[number] = found[number - 1] @ np.linalg.inv(poses[number - 1]) @ poses[number]
        if known and (surfels is None or since >= _RENEWED):
            surfels, since = make_surfels(cloud_of(thin, found, motion, known[-_WINDOW:]), settings)[0], 0
        if surfels is not None and len(thin[number]):
            xyz = thin[number].at_pose_time(motion[number])
            found[number] = place(xyz, found[number], surfels, settings.cell_m, rounds=3)
        if number in numbers and len(thin[number]):
            known.append(number)
            since += 1
    return found


def adjusted(
    scans: Sequence[LocalScan],
    poses: np.ndarray,
    motion: np.ndarray,
    numbers: Sequence[int],
    surfels: Surfels,
    cell_m: float,
) -> np.ndarray:
    """Poses (n, 4, 4) of all scans after one maximum-likelihood step, with surfels free along their normals.

    Args:
        scans: all of them.
        poses: (n, 4, 4) of the sensor.
        motion: (n, 6) of the sensor in a sweep.
        numbers: of the scans that take part; the first of them stays.
        surfels: made of these scans at these poses.
        cell_m: their size.
    """
    return _stepped(scans, poses, motion, np.zeros_like(motion), numbers, surfels, cell_m)[0]


def adjusted_with_sweep(
    scans: Sequence[LocalScan],
    poses: np.ndarray,
    motion: np.ndarray,
    scale: float,
    numbers: Sequence[int],
    surfels: Surfels,
    cell_m: float,
) -> tuple[np.ndarray, float, float]:
    """As `adjusted`; the share `scale` of the motion (n, 6) that is removed from the points is a further unknown.

    Returns:
        Poses, the share, and its standard error; points of one scan on one surfel count as one.
    """
    poses, change, error = _stepped(scans, poses, scale * motion, motion, numbers, surfels, cell_m)
    return poses, scale + change, error


def _stepped(
    scans: Sequence[LocalScan],
    poses: np.ndarray,
    motion: np.ndarray,
    further: np.ndarray,
    numbers: Sequence[int],
    surfels: Surfels,
    cell_m: float,
) -> tuple[np.ndarray, float, float]:
    """Poses after a step, how many times a further motion (n, 6) points are to be freed of, and its standard error."""
    count, size = len(numbers), len(surfels)
    own, right = np.zeros((count, 6, 6)), np.zeros(6 * count + 1)
    beside, alone = np.zeros(6 * count), _LEAST_TOLD
    weight, pulled, by_sweep = np.full(size, 1e-6), np.zeros(size), np.zeros(size)
    shared, squared, points, cells = [], 0.0, 0, 0
    for turn, number in enumerate(numbers):
        xyz, own_rows = scans[number].at_pose_time(motion[number]), slice(6 * turn, 6 * turn + 6)
        met = _matched(xyz, poses[number], surfels, cell_m)
        weighted = met.slope * met.weight[:, None]
        own[turn] = weighted.T @ met.slope + np.diag(_PRIOR)
        right[own_rows] = -weighted.T @ met.off
        squared += float(met.weight @ met.off**2)
        points, cells = points + len(met.row), cells + len(np.unique(met.row))
        weight += np.bincount(met.row, met.weight, size)
        pulled += np.bincount(met.row, met.weight * met.off, size)
        shared.append(sparse.csr_matrix(np.stack([np.bincount(met.row, column, size) for column in weighted.T])))
        if further[number].any():
            moved = scans[number].at_pose_time(motion[number] + further[number])[met.point] - xyz[met.point]
            along = np.einsum("ij,ij->i", moved @ poses[number, :3, :3].T, met.slope[:, 3:])
            beside[own_rows] = weighted.T @ along
            alone += float(met.weight @ along**2)
            right[-1] -= float((met.weight * along) @ met.off)
            by_sweep += np.bincount(met.row, met.weight * along, size)
    matrix: Any = linalg.block_diag(*own, alone)
    matrix[-1, :-1] = matrix[:-1, -1] = beside
    across: Any = sparse.vstack([*shared, sparse.csr_matrix(by_sweep)]).tocsc()
    right += across @ (pulled / weight)
    scaled: Any = across @ sparse.diags(1 / np.sqrt(weight))
    for start in range(0, size, _CHUNK):
        part = np.asarray(scaled[:, start : start + _CHUNK].todense())
        matrix -= part @ part.T
    matrix[:6, :6] += _HELD * np.eye(6)
    change = linalg.solve(matrix, right, assume_a="pos")
    found = poses.copy()
    for number, step in zip(numbers, change[:-1].reshape(-1, 6), strict=True):
        found[number] = nudged(poses[number], step)
    alone = linalg.solve(matrix, np.eye(len(matrix))[-1], assume_a="pos")[-1]
    return found, float(change[-1]), float(np.sqrt(alone * squared / max(cells, 1)))
