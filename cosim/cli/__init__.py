"""The command line: the only place that prints."""

import os

# Matrices here are too small for BLAS to gain by threads, and on busy cores these only wait for each other. NumPy reads
# this when it is first imported; whoever has set it before is obeyed.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cosim.cli.main import main

__all__ = ["main"]
