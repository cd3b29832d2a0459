"""Daylight: one sun, a hemisphere of sky, and the haze between."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sensors.cameras.errors import CameraError

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Light:
    """Light sources of the scene; a white horizontal face turned to sun and sky comes out near 1 by default.

    All colours are linear RGB. A face of albedo ρ and unit normal n shows
    ρ · (sun_rgb · max(0, n·s) + mix(ground_rgb, sky_rgb, (1 + n_z) / 2)).

    Attributes:
        sun_elevation_deg: height of the sun above the horizon.
        sun_azimuth_deg: direction of the sun in the world frame, counter-clockwise from +x (east).
        sun_rgb: light of the sun on a face turned towards it.
        sky_rgb: light of the sky on an upward face.
        ground_rgb: light the ground throws back on a downward face.
        zenith_rgb: colour of the sky overhead.
        horizon_rgb: colour of the sky at the horizon, and of the haze.
        haze_per_m: extinction of the haze; 0.0005 halves contrast at 1.4 km.
        exposure: factor on everything before encoding.
    """

    sun_elevation_deg: float = 45.0
    sun_azimuth_deg: float = 160.0
    sun_rgb: Rgb = (0.80, 0.76, 0.68)
    sky_rgb: Rgb = (0.36, 0.40, 0.46)
    ground_rgb: Rgb = (0.16, 0.15, 0.13)
    zenith_rgb: Rgb = (0.28, 0.45, 0.78)
    horizon_rgb: Rgb = (0.72, 0.79, 0.87)
    haze_per_m: float = 0.0006
    exposure: float = 1.0

    def __post_init__(self) -> None:
        if not -90.0 <= self.sun_elevation_deg <= 90.0:
            raise CameraError(f"sun_elevation_deg is {self.sun_elevation_deg}: give −90 to 90 degrees")
        if self.haze_per_m < 0 or self.exposure <= 0:
            raise CameraError(f"haze_per_m {self.haze_per_m} must be ≥ 0 and exposure {self.exposure} > 0")

    @property
    def sun_direction(self) -> Rgb:
        """Unit vector towards the sun, world frame (x east, y north, z up)."""
        elevation, azimuth = math.radians(self.sun_elevation_deg), math.radians(self.sun_azimuth_deg)
        flat = math.cos(elevation)
        return flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)
