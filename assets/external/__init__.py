"""Vehicle meshes from files: reading, materials, dimensions and axes."""

from assets.external.manifest import MANIFEST, VehicleEntry
from assets.external.material_words import sort_material
from assets.external.models import ExternalModels, load_external

__all__ = ["MANIFEST", "ExternalModels", "VehicleEntry", "load_external", "sort_material"]
