# Two commands: `make repro` and `make test`. Both set themselves up; `make help` lists the rest.
SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
export PYTHONPATH := $(CURDIR)/src
.DEFAULT_GOAL := help
.PHONY: help setup lock repro test kills reruns measured flags check check-paper params sweep mlflow app bench fuzz study clean

help:  ## what each target does
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

setup: $(VENV)/.installed  ## the environment, from requirements.lock

# Every file that is installed has a hash in the lock, build tools too. pip takes torch, since uv does not know that 2.13.0
# with the hash of a CPU build is one: from PIP_FIND_LINKS where it lies there, else from the index, with CUDA on Linux.
locked = <(sed -n '/^$(1)==/,/[^\\]$$/p' requirements.lock)
PIP_SETUP := -m pip install -q --disable-pip-version-check --require-hashes --no-deps
UV_SETUP := $(BIN)/uv pip install -q --python $(BIN)/python --no-deps --build-constraints requirements.lock

$(VENV)/.installed: requirements.lock requirements-cuda.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] < (3, 11))' || { echo "error: $(PYTHON) is older than Python 3.11; set PYTHON=python3.11"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python $(PIP_SETUP) -r $(call locked,uv)
	@$(BIN)/python $(PIP_SETUP) --no-index -r $(call locked,torch) 2>/dev/null || $(BIN)/python $(PIP_SETUP) -r $(call locked,torch)
	@$(UV_SETUP) --require-hashes -r requirements.lock
	@if $(BIN)/python -c 'import importlib.metadata as m, sys; sys.exit("+" in m.version("torch") or sys.platform != "linux")'; \
	  then $(UV_SETUP) --require-hashes -r requirements-cuda.lock; fi
	@$(UV_SETUP) -e .
	@touch $@

repro: setup  ## the whole pipeline on params.yaml as it stands (the demo corpus, unless changed)
	@python -m motionary.pipeline.params diff
	@python -m motionary.pipeline.repro $(if $(JOBS),--jobs $(JOBS))
	@python -m motionary.report.summary

test: setup  ## all tests, on every core, in a browser too, which is installed where there is none
	@python tests/browser.py
	@python -m pytest --numprocesses logical --dist loadfile --durations 40 --durations-min 5

kills: setup  ## kills the whole pipeline N times on a very small corpus and compares the results (hours; continues where it stopped)
	@python tests/kills.py --kills $(if $(N),$(N),100)

reruns: setup  ## how many stages each of the last N=40 commits would have run again, by the listings of their code
	@python tests/reruns.py -n $(or $(N),40)

lock: setup  ## writes requirements.lock anew from pyproject.toml, with hashes; versions stay (UPGRADE=1 takes the newest)
	@python tests/lock.py $(if $(UPGRADE),--upgrade)

measured: setup  ## reads 200 real clips turned, scaled and mirrored: up, unit and handedness
	@MOTIONARY_CLIPS=200 python -m pytest tests/formats/read/test_measured.py -k real_clips

flags: setup  ## plants faults in 500 real clips and counts those that `motionary index` flags, and sound clips that it flags too
	@MOTIONARY_FLAG_CLIPS=500 python -m pytest -s tests/archive/test_flags.py -k real_clips

check: setup  ## fast checks: style, types, generated files
	@ruff check . && ruff format --check .
	@pyright --pythonpath $(BIN)/python
	@python -m motionary.pipeline.params check

check-paper: setup  ## one step of every training at the papers' sizes: time and memory of each (about nine minutes of one thread)
	@python tests/check_paper.py

params: setup  ## recompose params.yaml from conf/
	@python -m motionary.pipeline.params write

sweep: setup  ## an example sweep: two learning rates of the tokenizer, in parallel, and a table of them
	@python stages/tokenizer.py -m tokenizer.learning_rate=1e-4,3e-4 hydra/launcher=joblib

mlflow: setup  ## the dashboard, at http://127.0.0.1:5000
	@python -m motionary.pipeline.dashboard --port $${PORT:-5000}

app: setup  ## the dictionary in a browser
	@motionary app

bench: setup  ## what work costs on one thread at the papers' shapes, beside yardsticks of the machine
	@python -m motionary.bench
	@python -m motionary.bench.threads
	@python -m motionary.bench.visitors

fuzz: setup  ## damaged inputs of every format, N=3000 of them or as many as fit into SECONDS: none may do more than say one line
	@PYTHONPATH=$(CURDIR)/tests:$(CURDIR)/src python -m fuzz -n $(or $(N),3000) --seconds $(or $(SECONDS),inf)

study: setup  ## seeds, second split, controls, ablations and baselines on the real clips (hours; continues where it stopped)
	@python -m motionary.study

clean:  ## remove outputs and caches of stages, keep the DVC cache and the tracking database
	@rm -rf models data/corpus data/.unfinished-* data/sources/.unfinished-* data/sources/root_* .cache .code outputs multirun dvc_plots
	@find reports -mindepth 1 -maxdepth 1 ! -name '*study' -exec rm -rf {} + 2> /dev/null || true
