# Every target sets up what it needs in .venv.
PYTHON := .venv/bin/python
COSIM := .venv/bin/cosim

# Some images forbid to keep compiled modules, so that each of hundreds of processes would compile them again.
export PYTHONDONTWRITEBYTECODE =

SECTIONS := lidar growth stages floor rates sizes memory loop effects

# One thread of linear algebra, as workers run.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.PHONY: demo test test-lowest slow check docs pictures weights bench hidden fuzz setup setup-dev clean $(SECTIONS)

demo: setup
	$(COSIM) run --town town01 --frames 12 --seed 1 --workers 2 --out out/demo/drive
	$(COSIM) view out/demo/drive --out out/demo

test: setup-dev
	$(ONE_THREAD) $(PYTHON) -m pytest -n 2 --dist worksteal

test-lowest:
	@sh tools/lowest.sh  # in out/lowest: the lowest versions of the dependencies that pyproject.toml allows

slow: setup-dev
	@echo "make slow: every town, fifty kills, an installation, all blocks of the docs; hours on two cores" >&2
	$(ONE_THREAD) $(PYTHON) -m pytest -m slow -n 2 --dist worksteal --durations=20

check: setup-dev
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m pyright
	.venv/bin/lint-imports
	.venv/bin/codespell README.md CHANGELOG.md CONTRIBUTING.md docs assets sumo_nets sensors cosim training tests tools

docs:
	@sh tools/setup.sh docs
	$(PYTHON) -m mkdocs build --strict  # out/site/index.html

pictures: setup-dev
	$(PYTHON) -m tools.pictures  # docs/img: what README and docs show of drives

weights: setup-dev
	$(COSIM) run training/weights/drive.yaml --out out/weights/drive --workers 2
	OMP_NUM_THREADS=1 $(COSIM) train training/weights/train.yaml --out out/weights/detector
	$(PYTHON) -m training.weights out/weights/detector/checkpoint.pt  # training/weights/pillars_small.pt

bench: setup-dev
	$(ONE_THREAD) $(PYTHON) -m tests.bench $(filter $(SECTIONS),$(MAKECMDGOALS))

$(SECTIONS): bench  # make bench growth
	@:

hidden: setup-dev
	$(ONE_THREAD) $(PYTHON) -m tests.hidden.benchmark
	$(ONE_THREAD) $(PYTHON) -m tests.hidden.traffic.benchmark

fuzz: setup-dev
	$(PYTHON) -m tests.fuzz

setup:
	@sh tools/setup.sh

setup-dev:
	@sh tools/setup.sh dev training docs

clean:
	rm -rf out .pytest_cache .ruff_cache
