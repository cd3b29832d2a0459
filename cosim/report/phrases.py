"""Formatting of p-values, lists and estimates in texts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

_TINY = 1e-7


def p_words(p_value: float) -> str:
    """Format a p-value: `p < 0.001` or `p = 0.012`."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.3f}"


def p_cell(p_value: float) -> str:
    """Format a p-value for a table column with the heading p."""
    return p_words(p_value).removeprefix("p ").removeprefix("= ")


def listed(names: Sequence[str], word: str = "and") -> str:
    """Join names for a sentence: `a, b and c`; names may be HTML (`Markup`)."""
    kind = Markup if any(isinstance(name, Markup) for name in names) else str
    return kind(f" {word} ").join([kind(", ").join(names[:-1]), names[-1]] if len(names) > 1 else names)


def round_with_error(value: float, half: float) -> tuple[str, str]:
    """Format a value and half its interval, both rounded to the second significant digit of the latter."""
    if 0 < half < _TINY:
        return f"{value:.6g}", f"{half:.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if half > 0 and np.isfinite(half) else 3
    return f"{value:.{digits}f}", f"{half:.{digits}f}"
