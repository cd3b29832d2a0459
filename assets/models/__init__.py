"""Parametric meshes of vehicles and people."""

from assets.models.build import build_model
from assets.models.catalogue import CATALOGUE, ModelSpec, model_spec

__all__ = ["CATALOGUE", "ModelSpec", "build_model", "model_spec"]
