"""What no candidate explains: on what it depends, in what shape, and as an effect that runs."""

from cosim.discrepancy.unknown.search import Shape, find_shape
from cosim.discrepancy.unknown.write import effect_source

__all__ = ["Shape", "effect_source", "find_shape"]
