"""Appearance: materials, parametric models, the static world."""

from assets.materials import MATERIALS, Material
from assets.mesh import Mesh
from assets.models import CATALOGUE, ModelSpec, build_model, model_spec
from assets.paints import Paint, draw_paint

__all__ = [
    "CATALOGUE",
    "MATERIALS",
    "Material",
    "Mesh",
    "ModelSpec",
    "Paint",
    "build_model",
    "draw_paint",
    "model_spec",
]
