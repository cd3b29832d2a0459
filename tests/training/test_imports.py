"""What does not compute with torch does not load it."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import assets
import cosim
import sensors
import sumo_nets
import training

_MAY_IMPORT = {
    assets: ("assets",),
    sumo_nets: ("sumo_nets", "assets"),
    sensors: ("sensors", "assets"),
    training: ("training", "cosim", "sensors", "assets"),
}


def test_importing_packages_and_scoring_do_not_import_torch():
    modules = "cosim.cli, training, training.data, training.models, training.evaluation, training.config"
    code = f"import sys, {modules}, training.experiments, training.openpcdet; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0


@pytest.mark.parametrize("package", _MAY_IMPORT, ids=lambda package: package.__name__)
def test_imports_run_one_way(package):
    ours = {one.__name__ for one in (assets, sumo_nets, sensors, cosim, training)}
    for file, module in _imports(package):
        top = module.split(".")[0]
        assert top not in ours or top in _MAY_IMPORT[package], f"{file} imports {module}"


def test_training_does_not_import_the_command_line():
    for file, module in _imports(training):
        assert not module.startswith("cosim.cli"), f"{file} imports {module}"


def _imports(package):
    """File and module of every import in a package."""
    for file in Path(package.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                yield from ((file, alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                yield file, node.module
