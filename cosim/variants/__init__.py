"""A drive measured again with other sensors."""

from cosim.variants.request import PAPER, VariantError
from cosim.variants.run import VariantsResult, make_variants

__all__ = ["PAPER", "VariantError", "VariantsResult", "make_variants"]
