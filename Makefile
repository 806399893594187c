# Needs git, make and any Python from 3.11 with pip; tools/bootstrap.py makes the rest in .uv and .venv.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-print-directory

STAMP := .venv/.glint-stamp
VENV_PYTHON := .venv/bin/python

.PHONY: help setup demo test lint package clean

help:  ## Say what each target does
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10

setup: $(STAMP)  ## Make the development environment (.venv)
	@:

$(STAMP): pyproject.toml .python-version tools/bootstrap.py
	@python=$$(sh tools/find_python.sh) && "$$python" tools/bootstrap.py

demo: $(STAMP)  ## Render the demo scenes into out/
	@$(VENV_PYTHON) -m demo_scenes

test: $(STAMP)  ## Run the tests (ARGS="-k words" chooses)
	@$(VENV_PYTHON) -m pytest --numprocesses 2 --dist loadfile $(ARGS)

lint: $(STAMP)  ## Check the style
	@$(VENV_PYTHON) -m ruff check .

package: $(STAMP)  ## Build and validate the extension in dist/
	@$(VENV_PYTHON) tools/package.py

clean:  ## Remove what is built; the environment stays
	@rm -rf dist out .pytest_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -not -path './.venv/*' -not -path './.uv/*' -prune -exec rm -rf {} +
