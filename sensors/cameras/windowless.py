"""Make pyrender importable without a window system.

Its viewer loads pyglet, and that the libraries of an X server, as soon as pyrender is imported; nothing here
opens a window. A viewer that was imported before is not changed.
"""

import sys
from types import ModuleType

if "pyrender" not in sys.modules:
    _viewer = ModuleType("pyrender.viewer")
    _viewer.Viewer = None  # type: ignore[attr-defined]
    sys.modules.setdefault("pyrender.viewer", _viewer)
