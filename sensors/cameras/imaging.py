"""Image formation: structure of surfaces, exposure, vignetting, blur, shot noise and read noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from sensors.cameras.images import Images


class Imaging(BaseModel):
    """A camera's imperfections; none is active by default.

    `texture` multiplies the light of surfaces by reflectance fields that are fixed to them, the same that the
    LiDAR's sensor has (`sensors.cameras.texture`). The others act on linear light, of which images hold the square
    root: s·L·2^ev·(1 − vignetting·r²) with s = `sky` in the sky and 1 elsewhere, blurred, then counted in electrons,
    whose variance is their number plus the square of the read noise (EMVA Standard 1288, release 4.0, section 2.3), and
    cut at the full well.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    texture: float = Field(
        default=0.0, ge=0, le=5, description="structure of surfaces over that which LiDAR sensors see [1]"
    )
    sky: float = Field(default=1.0, ge=0, le=100, description="light of the sky over that of the renderer [1]")
    exposure_ev: float = Field(default=0.0, ge=-8, le=8, description="exposure compensation, positive is brighter [EV]")
    vignetting: float = Field(default=0.0, ge=0, le=1, description="loss of light in the corners [1]")
    blur_px: float = Field(default=0.0, ge=0, le=20, description="standard deviation of the blur [px]")
    full_well_e: float | None = Field(
        default=None, ge=50, le=1e7, description="electrons of a white pixel; fewer are noisier; none: no noise [e−]"
    )
    read_noise_e: float = Field(default=0.0, ge=0, le=1e4, description="standard deviation in the dark [e−]")

    @property
    def does_nothing(self) -> bool:
        """Whether images stay as they are."""
        return not (self.sky != 1 or self.exposure_ev or self.vignetting or self.blur_px or self.full_well_e)

    def seen(self, images: Images, rng: np.random.Generator) -> Images:
        """Return the images with these imperfections; materials, instances and depths do not change.

        Args:
            images: with colour, or without, which changes nothing.
            rng: of the noise.
        """
        if images.rgba is None or self.does_nothing:
            return images
        light = np.square(images.rgba[..., :3].astype(np.float32) / 255.0)
        light *= np.float32(2.0**self.exposure_ev)
        light[images.material == 0] *= np.float32(self.sky)
        if self.vignetting:
            light *= self._falloff(light.shape[:2])[..., None]
        if self.blur_px:
            light = cv2.GaussianBlur(light, (0, 0), self.blur_px)
        if self.full_well_e is not None:
            electrons = light * np.float32(self.full_well_e)
            sigma = np.sqrt(electrons + np.float32(self.read_noise_e**2))
            light = (electrons + sigma * rng.standard_normal(light.shape, np.float32)) / np.float32(self.full_well_e)
        rgba = images.rgba.copy()
        rgba[..., :3] = np.rint(255.0 * np.sqrt(np.clip(light, 0.0, 1.0)))
        return replace(images, rgba=rgba)

    def _falloff(self, shape: tuple[int, int]) -> np.ndarray:
        """Share of light by pixel, (h, w) float32: 1 in the middle, 1 − vignetting in the corners."""
        v, u = (np.linspace(-1, 1, count, dtype=np.float32) for count in shape)
        aspect = shape[1] / shape[0]
        square = (np.square(u * aspect)[None, :] + np.square(v)[:, None]) / (aspect**2 + 1)
        return 1 - np.float32(self.vignetting) * square
