"""The table of what was asked first, and how much each would explain by itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from cosim.report.parts import meter, section, table
from cosim.report.phrases import p_cell

_MOST = 12


def ranking_section(rows: Sequence[tuple[str, float, float]], remarks: Sequence[str] = (), note: str = "") -> str:
    """HTML; empty without rows.

    Args:
        rows: name, fall of the BIC and p-value of each, the likeliest first.
        remarks: a word on each; none at all by default.
        note: what else to know of the numbers.
    """
    if not rows:
        return ""
    best = max(max(delta for _, delta, _ in rows), 1e-9)
    cells = [
        [escape(name), f"{delta:,.0f}", meter(delta / best), escape(p_cell(p_value))]
        + ([escape(remarks[number])] if remarks else [])
        for number, (name, delta, p_value) in enumerate(rows[:_MOST])
    ]
    text = "How much each would lower the BIC by itself: differences above 10 decide."
    text += f" {escape(note)}" if note else ""
    heads = ["", "ΔBIC", "", "p", *([""] if remarks else [])]
    return section("Candidates of the first round", table(heads, cells, words=(4,)), text=text)
