"""The twin of a drive: its world and models as glTF, materials as YAML, and every frame's poses as JSON."""

from cosim.drives.twin.frame import Camera, Ego, Instance, InstanceTexts, Lidar, TwinFrame, read_frame, write_frame
from cosim.drives.twin.glb import encode_glb, read_glb, write_glb
from cosim.drives.twin.materials import MaterialEntry, format_materials, read_materials, write_materials

__all__ = [
    "Camera",
    "Ego",
    "Instance",
    "InstanceTexts",
    "Lidar",
    "MaterialEntry",
    "TwinFrame",
    "encode_glb",
    "format_materials",
    "read_frame",
    "read_glb",
    "read_materials",
    "write_frame",
    "write_glb",
    "write_materials",
]
