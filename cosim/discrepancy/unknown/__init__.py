"""What no candidate explains: on what it depends, in what shape, and as an effect that runs."""

from cosim.discrepancy.unknown.candidate import rank_shape, shape_effect, shape_gate, spread_of_gain
from cosim.discrepancy.unknown.shape import Shape, find_shape, same_shape
from cosim.discrepancy.unknown.write import class_name, effect_name, effect_source

__all__ = [
    "Shape",
    "class_name",
    "effect_name",
    "effect_source",
    "find_shape",
    "rank_shape",
    "same_shape",
    "shape_effect",
    "shape_gate",
    "spread_of_gain",
]
