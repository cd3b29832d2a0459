"""Earlier names of the modules of effects, such as `sensors.effects.range_bias`."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

_PACKAGE, _FOLDER = "sensors.effects", Path(__file__).parent


class OldNames(MetaPathFinder, Loader):
    """Finds a module by its earlier name, and warns."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Find the module of a name that no other finder knows."""
        package, _, name = fullname.rpartition(".")
        rooms = _FOLDER.glob(f"*/{name}.py") if package == _PACKAGE else iter(())
        return next((ModuleSpec(fullname, self, origin=f"{package}.{one.parent.name}.{name}") for one in rooms), None)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module itself, so that there is one class of each effect."""
        assert spec.origin is not None  # see above
        warnings.warn(f"{spec.name} is {spec.origin} now; import that", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(spec.origin)
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the module's own name."""
        assert module.__spec__ is not None  # of the old name
        module.__spec__ = module.__spec__.loader_state


def know_old_names() -> None:
    """Register the finder of earlier names as the last one."""
    if not any(isinstance(one, OldNames) for one in sys.meta_path):
        sys.meta_path.append(OldNames())
