"""Persons who ride in vehicles: SUMO's output lists them at the front bumper of the vehicle that carries them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.traffic.trajectories.tracks import TrackSample


def is_rider(
    samples: Sequence[TrackSample], on_foot: Sequence[bool], carried: Sequence[bool] | None = None
) -> np.ndarray:
    """Mask (n,) of samples of persons who ride in a vehicle.

    A person rides who has the place, heading and speed of a vehicle at the same time, to the digits of the file.

    Args:
        samples: of SUMO's output.
        on_foot: which of them are of persons.
        carried: those of which the file itself names the vehicle.
    """
    states = [
        (sample.time_s, sample.x_m, sample.y_m, round(sample.heading_rad, 9), sample.speed_mps) for sample in samples
    ]
    vehicles = {state for state, walks in zip(states, on_foot, strict=True) if not walks}
    found = np.array([walks and state in vehicles for state, walks in zip(states, on_foot, strict=True)], bool)
    return found if carried is None else found | np.array(carried, bool)
