"""What does not compute with torch does not load it."""

from __future__ import annotations

import subprocess
import sys


def test_importing_packages_and_scoring_leave_torch_alone():
    modules = "cosim.cli, training, training.data, training.models, training.evaluation, training.config"
    code = f"import sys, {modules}, training.experiments, training.openpcdet; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0
