"""Each single effect of the catalogue: what it changes, and that other channels do not change."""

from __future__ import annotations

from rich.table import Table

from sensors.effects.registry import built_in_effects
from tests.sensors.effects.alone import Change, change_by

_CHANNELS = ("range", "intensity", "drop", "spurious", "label")


def table() -> Table:
    """A line an effect: the share of beams that it changes, by channel, with the parameters of its example."""
    found = Table(
        title="Single effects: share of beams changed (of boxes: label)",
        caption="room: closed, of one material; street: road, walls, glass, sign, two moving cars. In brackets: what "
        "the effect says it cannot but touch. `yes`: its own channel changes, and none that it does not name.",
    )
    for column in ("effect", "about", "scene", *_CHANNELS, "median |ΔR|", "median |ΔI|", "alone"):
        found.add_column(column, justify="left" if column in ("effect", "about", "scene") else "right", no_wrap=True)
    changes = [change_by(name) for name in built_in_effects()]
    for change in changes:
        found.add_row(*_cells(change))
    found.add_section()
    found.add_row(f"{sum(change.holds for change in changes)} of {len(changes)} hold")
    return found


def _cells(change: Change) -> list[str]:
    kind = built_in_effects()[change.name]
    about = kind.channel + (f" ({', '.join(kind.also)})" if kind.also else "")
    shares = [_percent(share) for share in (change.shares[channel] for channel in _CHANNELS)]
    sizes = [
        f"{change.range_m * 1e3:.3g} mm" if change.range_m else "",
        f"{change.intensity:.2g}" if change.intensity else "",
    ]
    return [change.name, about, change.scene, *shares, *sizes, "yes" if change.holds else "NO"]


def _percent(share: float) -> str:
    if not share:
        return ""
    return f"{share:.2%}" if share >= 5e-5 else "< 0.01%"
