"""`python -m cosim`: the command line."""

from __future__ import annotations

import sys

from cosim.cli import main

if __name__ == "__main__":
    sys.exit(main())
