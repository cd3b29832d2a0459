"""Import rules of the discrepancy packages: each package imports only packages below it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import cosim.discrepancy

HOME = "cosim.discrepancy"
ROOMS = ("data", "forward", "sampling", "inference", "unknown", "dictionary", "selection", "report")
"""Each may import those before it. Other modules of the folder are imported by pages only, except `EVERYWHERE`."""
EVERYWHERE = ("settings", "candidates", "analysis")


def modules(*, whole: bool = False) -> dict[str, set[str]]:
    """Modules of the loop by name below `cosim.discrepancy`, with those they import when they are imported.

    Of whole modules with those, too, that functions of theirs import.
    """
    root = Path(str(cosim.discrepancy.__file__)).parent
    return {
        ".".join(file.relative_to(root).with_suffix("").parts): set(
            _imported(ast.parse(file.read_text("utf-8")), whole)
        )
        for file in root.rglob("*.py")
        if file.name != "__init__.py"
    }


def _imported(tree: ast.Module, whole: bool) -> Iterator[str]:
    for node in ast.walk(tree) if whole else tree.body:  # imports in functions, or only for types, come later
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{HOME}."):
            yield node.module.removeprefix(f"{HOME}.")


def test_no_module_leads_back_to_itself() -> None:
    order = list(TopologicalSorter(modules()).static_order())
    assert order.index("settings") < order.index("diagnose")


@pytest.mark.parametrize("room", ROOMS)
def test_package_imports_nothing_from_higher_packages(room: str) -> None:
    below = {*ROOMS[: ROOMS.index(room) + 1], *EVERYWHERE}
    for module, imports in modules().items():
        if module.startswith(f"{room}.") and room != "report":
            for one in imports:
                assert one.split(".")[0] in below, f"{module} imports {one}"


def test_only_pages_know_of_pages() -> None:
    for module, imports in modules(whole=True).items():
        assert module.startswith("report.") or not any(one.startswith("report.") for one in imports), module
