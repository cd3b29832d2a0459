#!/bin/sh
# Runs the tests with the lowest versions of the direct dependencies that pyproject.toml allows.
# torch keeps its tested version: older builds for CPUs are on another index.
set -eu
cd "$(dirname "$0")/.."

folder=out/lowest
extras=export,openscenario,readers,recordings,stats
python=$folder/venv/bin/python
mkdir -p "$folder"
[ -x "$python" ] || python3 -m venv "$folder/venv"
"$python" -m pip install -q --disable-pip-version-check uv
"$python" -m uv pip compile -q --resolution lowest-direct $(printf -- ' --extra %s' $(echo "$extras" | tr , ' ')) \
    pyproject.toml -o "$folder/constraints.txt"
grep -E '^torch==' constraints.txt > "$folder/torch.txt"
"$python" -m pip install -q --disable-pip-version-check -c "$folder/constraints.txt" -e ".[$extras]"
"$python" -m pip install -q --disable-pip-version-check -r "$folder/torch.txt" tensorboard pytest pytest-xdist pytest-cov \
    filelock hypothesis pillow distributed
"$python" -m pytest -n 2 --dist worksteal "$@"
