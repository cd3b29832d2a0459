"""SUMO's library together with other libraries."""

from __future__ import annotations

import subprocess
import sys


def test_another_version_of_pyarrow_makes_no_noise() -> None:
    code = (
        "import importlib.metadata as metadata; real = metadata.version; "
        "metadata.version = lambda name: '99.0.1' if name == 'pyarrow' else real(name); "
        "from cosim.traffic.starting import load_libsumo; load_libsumo().getVersion(); print('loaded')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "loaded" and not done.stderr
