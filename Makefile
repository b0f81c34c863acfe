# Every target builds what it needs first; the second time that takes about a second.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup demo test bench gallery lint clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile

setup: ## build .venv and the ROS packages, as far as they are out of date
	@tools/setup

demo: setup ## plan, fly and replay an example; pictures and recordings go to demo/
	@tools/run python -m flightdyn.nodes.demo demo/

test: setup ## run the tests; ARGS='...' goes to pytest, e.g. ARGS='-m slow'
	@# DDS may lose the first call to a node that has just begun: such a test is done again
	@ROS_PYTHON_CHECK_FIELDS=1 tools/run python -m pytest -n auto --maxprocesses 4 --dist loadfile \
		--reruns 2 --only-rerun NodeTimeout $(ARGS)

bench: ## run every benchmark
	@tools/setup bench
	@set -e; for file in benchmarks/*.py; do tools/run python "$$file"; done

gallery: setup ## make docs/gallery.md and its pictures anew; ARGS='...' names some pictures
	@tools/run python tools/gallery.py $(ARGS)

lint: setup ## check style and types
	@tools/run ruff check .
	@tools/run ruff format --check .
	@tools/run mypy flightdyn

clean: ## remove all that was built, except .venv
	rm -rf build install log demo *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
