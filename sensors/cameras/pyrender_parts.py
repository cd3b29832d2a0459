"""Modules of pyrender without the package's own imports.

`import pyrender` loads trimesh, networkx, fonts and the viewer of a window system. Contexts and shader programs need
none of these.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from types import ModuleType


def import_part(name: str) -> ModuleType:
    """Import a module of pyrender, such as `shader_program`, that does not need the rest of the package.

    Raises:
        ImportError: pyrender is not installed.
    """
    if "pyrender" in sys.modules:
        return import_module(f"pyrender.{name}")
    spec = find_spec("pyrender")
    if spec is None:
        raise ImportError("pyrender is not installed: pip install pyrender2")
    sys.modules["pyrender"] = module_from_spec(spec)  # knows where its modules are, but has not run
    try:
        return import_module(f"pyrender.{name}")
    finally:
        del sys.modules["pyrender"]  # whoever imports pyrender itself gets all of it
