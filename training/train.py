"""`python -m training.train CONFIG.yaml`: the same as `cosim train CONFIG.yaml`."""

from __future__ import annotations

import sys

from cosim.cli import main

if __name__ == "__main__":
    sys.exit(main(["train", *sys.argv[1:]]))
