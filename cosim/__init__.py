"""Simulated LiDAR data in KITTI's format, and how far it is from reality.

What most scripts need is here; it is imported when it is first used. The command line is in `cosim.cli`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosim.capture.config import RunConfig, load_config
    from cosim.capture.runner import RunResult, run
    from cosim.discrepancy import Added, Comparison, Diagnosis, add, compare, diagnose
    from cosim.drives.kitti import Drive, Frame
    from cosim.engine import LocalEngine
    from cosim.errors import CosimError
    from cosim.variants import make_variants

__all__ = [
    "Added",
    "Comparison",
    "CosimError",
    "Diagnosis",
    "Drive",
    "Frame",
    "LocalEngine",
    "RunConfig",
    "RunResult",
    "add",
    "compare",
    "diagnose",
    "load_config",
    "make_variants",
    "run",
]

_HOMES = {
    "capture.config": ("RunConfig", "load_config"),
    "capture.runner": ("RunResult", "run"),
    "discrepancy": ("Added", "Comparison", "Diagnosis", "add", "compare", "diagnose"),
    "drives.kitti": ("Drive", "Frame"),
    "engine": ("LocalEngine",),
    "errors": ("CosimError",),
    "variants": ("make_variants",),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"cosim.{home}"), name)
    raise AttributeError(f"module 'cosim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
