"""A process answers for the memory that it holds itself."""

import subprocess
import sys

import pytest

from cosim.engine.child import peak_bytes

HELD = 400 * 2**20


def test_what_was_held_counts_after_it_has_gone():
    kept = bytearray(HELD)
    del kept
    assert peak_bytes() > HELD


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process inherits its parent's peak")
def test_what_the_parent_holds_does_not_count():
    kept = bytearray(HELD)
    message = subprocess.check_output(
        [sys.executable, "-c", "from cosim.engine.child import peak_bytes; print(peak_bytes())"]
    )
    assert int(message) < HELD < len(kept) + 1
