# Needs git, make and any Python from 3.11 with pip; tools/bootstrap.py makes the rest in .uv and .venv.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-print-directory

STAMP := .venv/.glint-stamp
VENV_PYTHON := .venv/bin/python

.PHONY: help setup demo gallery contact-sheet test stress lint package truth bench bench-quick screenshots clean

help:  ## Say what each target does
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

setup: $(STAMP)  ## Make the development environment (.venv)
	@:

$(STAMP): pyproject.toml .python-version tools/bootstrap.py
	@python=$$(sh tools/find_python.sh) && "$$python" tools/bootstrap.py

demo: $(STAMP)  ## Render the demo scenes into out/
	@$(VENV_PYTHON) -m demo_scenes

gallery: $(STAMP)  ## Render the demo's scenes and those comparisons that take longer
	@$(VENV_PYTHON) -m demo_scenes --all

contact-sheet: $(STAMP)  ## Render all presets into docs/presets.jpg, and their thumbnails (an hour)
	@$(VENV_PYTHON) -m demo_scenes --presets

PYTEST := $(VENV_PYTHON) -m pytest --numprocesses 2 --dist worksteal

# What waits for `make stress` is left out, unless ARGS name a file: then every test in it runs.
test: $(STAMP)  ## Run the tests (ARGS="-k words" chooses, ARGS="-m stress -k words" among those of `make stress`)
	@$(PYTEST) $(if $(findstring tests/,$(ARGS)),,-m "not stress" )$(ARGS)

stress: $(STAMP)  ## Run what is statistical and list every stress case in benchmarks/RESULTS.md
	@$(PYTEST) -m stress tests --stress-report benchmarks/results/stress.json
	@$(VENV_PYTHON) -m benchmarks report

lint: $(STAMP)  ## Check the style and the types
	@$(VENV_PYTHON) -m ruff check .
	@$(VENV_PYTHON) -m mypy

package: $(STAMP)  ## Build and validate the extension in dist/
	@$(VENV_PYTHON) tools/package.py

truth: $(STAMP)  ## Render the stored truth of a scene of the benchmark again (SCENE=name; minutes to hours)
	@$(VENV_PYTHON) -m benchmarks truth $(or $(SCENE),$(error Say which scene: make truth SCENE=name))

bench: $(STAMP)  ## Measure run time against error, write tables and plots (well over an hour on an idle machine)
	@$(VENV_PYTHON) -m benchmarks run $(ARGS)

bench-quick: $(STAMP)  ## Compare what the lobe does on two scenes with the limits (counts; times inform)
	@$(VENV_PYTHON) -m benchmarks quick >/dev/null  # where Blender names every picture it saves

screenshots: $(STAMP)  ## Take the pictures of Blender's window in docs/ (needs the application, and a screen)
	@rm -rf out/screenshots
	@$(VENV_PYTHON) tools/screenshots.py out/screenshots
	@$(or $(BLENDER),blender) --factory-startup --window-geometry 0 0 1300 1000 \
	    --python tools/screenshots.py -- out/screenshots $(ARGS)
	@cp out/screenshots/panel.png out/screenshots/node.png out/screenshots/eevee.png docs/

clean:  ## Remove what is built; the environment stays
	@rm -rf dist out .pytest_cache .ruff_cache .mypy_cache .hypothesis
	@find . -name __pycache__ -not -path './.venv/*' -not -path './.uv/*' -prune -exec rm -rf {} +
