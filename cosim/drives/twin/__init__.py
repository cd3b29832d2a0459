"""The twin of a drive: its world and models as glTF, materials as YAML, every frame's poses as JSON, and its trust."""

from cosim.drives.twin.frame import Ego, Instance, InstanceTexts, Lidar, TwinCamera, TwinFrame, read_frame, write_frame
from cosim.drives.twin.glb import encode_glb, read_glb, write_glb
from cosim.drives.twin.materials import MaterialEntry, format_materials, read_materials, write_materials
from cosim.drives.twin.trust import Trust, encode_trust, read_trust

__all__ = [
    "Ego",
    "Instance",
    "InstanceTexts",
    "Lidar",
    "MaterialEntry",
    "Trust",
    "TwinCamera",
    "TwinFrame",
    "encode_glb",
    "encode_trust",
    "format_materials",
    "read_frame",
    "read_glb",
    "read_materials",
    "read_trust",
    "write_frame",
    "write_glb",
    "write_materials",
]
