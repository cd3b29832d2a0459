"""One revolution of the head, a row a beam, from what it meets to what is written down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.hidden.head import Aim, Beams
from tests.hidden.twin_files import MaterialTable
from tests.hidden.twin_tracing import Surfaces, Twin

Reach = tuple[float, float]
Cast = Callable[[np.ndarray, np.ndarray, np.ndarray | float, Reach], tuple[Surfaces, Surfaces]]


@dataclass(eq=False)
class Scan:
    """What each beam answers; hidden effects change it in place.

    Attributes:
        frame: the frame's JSON.
        elapsed_s: pose time since the drive's first frame.
        beams, aim, table: see there.
        origin, direction: true rays in world axes, (n, 3) or (3,), and (n, 3).
        solid, pane: first solid surface and first pane.
        cast: casts further rays at the same world: origin, direction, time, reach.
        found: (n,) bool, a return is reported.
        range_m: (n,) its range.
        intensity: (n,) its intensity.
        rho: (n,) bare reflectance of what answers.
        cos: (n,) its cosine of incidence.
        material, instance: (n,) what answers.
    """

    frame: dict
    elapsed_s: float
    beams: Beams
    aim: Aim
    table: MaterialTable
    origin: np.ndarray
    direction: np.ndarray
    solid: Surfaces
    pane: Surfaces
    cast: Cast
    found: np.ndarray
    range_m: np.ndarray
    intensity: np.ndarray
    rho: np.ndarray
    cos: np.ndarray
    material: np.ndarray
    instance: np.ndarray

    def reflectance(self, material: np.ndarray, instance: np.ndarray) -> np.ndarray:
        """Reflectance at 905 nm; paint is the instance's."""
        rho = self.table.reflectance[material]
        paint = np.array([thing["paint"] for thing in self.frame["instances"]] or [0.0], np.float32)
        painted = self.table.paint[material] & (instance >= 0)
        return np.where(painted, paint[np.maximum(instance, 0)], rho)

    def answer(self, rows: np.ndarray, distance, rho, intensity, surfaces: Surfaces, of: np.ndarray) -> None:
        """Let beams `rows` be answered by rows `of` of other surfaces."""
        self.found[rows], self.range_m[rows], self.rho[rows], self.intensity[rows] = True, distance, rho, intensity
        self.cos[rows] = surfaces.cos[of]
        self.material[rows], self.instance[rows] = surfaces.material[of], surfaces.instance[of]

    def before_solid(self) -> np.ndarray:
        """(n,) bool: the beam meets glass first."""
        return self.pane.distance < self.solid.distance

    def points(self) -> dict[str, np.ndarray]:
        """The reported points and their rays, ring-major."""
        kept = np.flatnonzero(self.found)
        centre = np.zeros((len(kept), 3))
        centre[:, 2] = self.aim.centre_z[kept]
        xyz = centre + self.range_m[kept, None] * self.beams.direction[kept]
        return {
            "points": np.column_stack([xyz, self.intensity[kept]]).astype("<f4"),
            "ring": self.beams.ring[kept].astype(np.uint8),
            "azimuth": self.beams.azimuth[kept].astype(np.float32),
            "time_s": self.beams.time_s[kept].astype(np.float32),
            "return_no": np.zeros(len(kept), np.uint8),
        }


def bare_scan(
    twin: Twin,
    frame: dict,
    beams: Beams,
    aim: Aim,
    elapsed_s: float = 0.0,
    known: tuple[Surfaces, Surfaces] | None = None,
) -> Scan:
    """Trace a revolution; `known` are the surfaces of an earlier trace of the same rays."""
    origin, direction = aim.rays(frame)

    def cast(start, heading, after, reach):
        return twin.cast(frame, start, heading, after, reach)

    solid, pane = known or cast(origin, direction, aim.after, beams.range_m)
    scan = Scan(
        frame, elapsed_s, beams, aim, twin.table, origin, direction, solid, pane, cast,
        found=np.isfinite(solid.distance),
        range_m=np.where(np.isfinite(solid.distance), solid.distance, 0).astype(float),
        intensity=np.zeros(len(direction)), rho=np.zeros(len(direction)), cos=solid.cos.astype(float),
        material=solid.material.copy(), instance=solid.instance.copy(),
    )  # fmt: skip
    scan.rho = np.where(scan.found, scan.reflectance(solid.material, solid.instance), 0).astype(float)
    scan.intensity = scan.rho.copy()
    return scan
