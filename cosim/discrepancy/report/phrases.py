"""Words that all findings share."""

from __future__ import annotations

import numpy as np

_TINY = 1e-7


def p_words(p_value: float) -> str:
    """A p-value as papers write it."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.3f}"


def p_cell(p_value: float) -> str:
    """The same in a column that is headed p."""
    return p_words(p_value).removeprefix("p ").removeprefix("= ")


def listed(names: list[str], word: str = "and") -> str:
    """Names as a sentence lists them."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def as_sure(value: float, half: float) -> tuple[str, str]:
    """A value and half its interval, both to the second digit of the latter."""
    if 0 < half < _TINY:
        return f"{value:.6g}", f"{half:.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if half > 0 and np.isfinite(half) else 3
    return f"{value:.{digits}f}", f"{half:.{digits}f}"
