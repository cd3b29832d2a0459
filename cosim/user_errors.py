"""All errors that the user can fix, of all packages."""

from __future__ import annotations


def user_errors() -> tuple[type[Exception], ...]:
    """For `except user_errors()`, which Python asks only after something was raised: nothing is imported before."""
    from assets.errors import AssetError
    from cosim.errors import CosimError
    from sensors.cameras.errors import CameraError
    from sensors.errors import SensorError
    from sumo_nets.errors import TownError

    return AssetError, CosimError, CameraError, SensorError, TownError
