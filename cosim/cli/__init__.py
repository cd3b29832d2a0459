"""The command line: the only place that prints."""

import os

# The matrices are too small to benefit from BLAS threads. NumPy reads this variable when it is first imported; a value
# set by the user is kept.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cosim.cli.main import main

__all__ = ["main"]
