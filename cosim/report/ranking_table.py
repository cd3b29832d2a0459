"""Table of the candidates in the first selection round and their BIC differences."""

from __future__ import annotations

from collections.abc import Sequence

from cosim.report.parts import meter, section, table
from cosim.report.phrases import p_cell

_MOST = 12


def ranking_section(rows: Sequence[tuple[str, float, float]], remarks: Sequence[str] = (), note: str = "") -> str:
    """HTML of the section; empty without rows.

    Args:
        rows: name, decrease of the BIC and p-value of each candidate, the best first.
        remarks: optional remark on each candidate.
        note: additional sentence about the numbers.
    """
    if not rows:
        return ""
    best = max(max(delta for _, delta, _ in rows), 1e-9)
    cells = [
        [name, f"{delta:,.0f}", meter(delta / best), p_cell(p_value)] + ([remarks[number]] if remarks else [])
        for number, (name, delta, p_value) in enumerate(rows[:_MOST])
    ]
    text = "Decrease of the BIC by each single candidate; a difference above 10 is decisive."
    text += f" {note}" if note else ""
    heads = ["", "ΔBIC", "", "p", *([""] if remarks else [])]
    return section("Candidates of the first round", table(heads, cells, words=(4,)), text=text)
