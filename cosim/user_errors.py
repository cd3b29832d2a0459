"""All errors that are the user's to mend, whichever package raises them."""

from assets.errors import AssetError
from cosim.errors import CosimError
from sensors.cameras.errors import CameraError
from sensors.errors import SensorError
from sumo_nets.errors import TownError

USER_ERRORS = (AssetError, CosimError, CameraError, SensorError, TownError)
