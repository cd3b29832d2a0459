"""The table of what was asked first, and how much each would explain by itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from cosim.discrepancy.report.phrases import p_cell

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
    cells = []
    for number, (name, delta, p_value) in enumerate(rows[:_MOST]):
        remark = f"<td class=words>{escape(remarks[number])}</td>" if remarks else ""
        cells.append(
            f'<tr><th>{escape(name)}</th><td>{delta:,.0f}</td><td><span class="meter"><i '
            f'style="width:{100 * max(delta, 0) / best:.1f}%"></i></span></td>'
            f"<td>{escape(p_cell(p_value))}</td>{remark}</tr>"
        )
    return (
        "<section><h2>Candidates of the first round</h2><p>How much each would lower the BIC by itself: differences "
        f"above 10 decide.{note and f' {escape(note)}'}</p><table><thead><tr><th></th><th>ΔBIC</th><th></th><th>p</th>"
        f"{'<th></th>' if remarks else ''}</tr></thead><tbody>{''.join(cells)}</tbody></table></section>"
    )
