"""``dvc repro`` with independent stages side by side: ``python -m motionary.pipeline.repro [--jobs N]``.

DVC runs one stage at a time. Most stages leave cores idle (they start, draw, or work on matrices too small to share),
so this runs every stage whose dependencies are up to date, up to N at once, each as ``dvc repro --single-item``, with
its share of the cores. What is run, locked and cached is as under ``dvc repro``, and either continues the other.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from motionary.errors import InputError
from motionary.pipeline import guard
from motionary.pipeline.check import check_params
from motionary.pipeline.delivery import left_in
from motionary.pipeline.journal import WATCHED
from motionary.pipeline.lacking import lacking, told
from motionary.pipeline.leftovers import wait_for_running

_POLL, _GRACE = 0.2, 60.0  # seconds between two looks at the stages, and for a stopped one to end by itself
_DELIVERY = 60.0  # seconds for what the last stages tell MLflow; what takes longer stays for later


class Process(Protocol):
    """A running stage, as far as scheduling goes."""

    def poll(self) -> int | None:
        """The exit code, None while it runs."""


def take_stock(root: Path) -> None:
    """Runs what DVC always runs (the stage `code`): only then is it known what has changed. No other stage is run."""
    from dvc.repo import Repo
    from dvc.repo.reproduce import reproduce

    logging.disable(logging.INFO)  # it is no work to speak of
    try:
        with Repo(str(root)) as repo:
            for name in [stage.addressing for stage in repo.index.stages if stage.always_changed]:
                reproduce(repo, name, single_item=True)
    finally:
        logging.disable(logging.NOTSET)


def outdated(root: Path) -> dict[str, set[str]]:
    """Stages of the pipeline in `root` that may have to run -> those of them that each depends on.

    These are the stages that ``dvc status`` names and everything downstream of them, but for those that DVC always
    runs: see `take_stock`.
    """
    import networkx
    from dvc.repo import Repo

    with Repo(str(root)) as repo:
        graph = repo.index.graph  # an edge leads from a stage to what it needs
        always = {stage.addressing for stage in graph if stage.always_changed}
        graph = networkx.relabel_nodes(graph, {stage: stage.addressing for stage in graph})
        changed = set(repo.status()) - always
    stages = changed.union(*(networkx.ancestors(graph, name) for name in changed))
    return {name: networkx.descendants(graph, name) & stages for name in stages}


def schedule(
    needs: Mapping[str, set[str]],
    start: Callable[[str, int, bool], Process],
    jobs: int,
    wait: Callable[[], None] = lambda: time.sleep(_POLL),
    hopeless: Callable[[set[str]], set[str]] = lambda done: set(),
) -> tuple[list[str], set[str]]:
    """Runs stages in an order that respects `needs`, at most `jobs` at once; returns those that failed and those
    that were left out.

    After a failure nothing new is started, what runs is let finish.

    Args:
        needs: stage -> every stage that must have ended well before.
        start: (stage, free slot below `jobs`, whether it is bound to run alone) -> its process.
        wait: called between two looks at the processes.
        hopeless: given what has ended well, the stages that cannot: they and what needs them are left out.
    """
    # Whatever holds up most of the others goes first; then by name, so that runs are alike.
    weight = {name: sum(name in others for others in needs.values()) for name in needs}
    waiting = sorted(needs, key=lambda name: (-weight[name], name))
    running: dict[str, tuple[int, Process]] = {}
    done: set[str] = set()
    failed: list[str] = []
    left: set[str] = set()
    while running or (waiting and not failed):
        bad = hopeless(done)
        left |= {name for name in waiting if name in bad or needs[name] & bad}
        waiting = [name for name in waiting if name not in left]
        ready = [] if failed else [name for name in waiting if needs[name] <= done]
        alone = not running and len(ready) == 1
        for name in ready[: jobs - len(running)]:
            slot = min(set(range(jobs)) - {slot for slot, _ in running.values()})
            running[name] = slot, start(name, slot, alone)
            waiting.remove(name)
        ended = {name: code for name, (_, process) in running.items() if (code := process.poll()) is not None}
        for name, code in ended.items():
            del running[name]
            if code == 0:
                done.add(name)
            else:
                failed.append(name)
        if running and not ended:
            wait()
    return failed, left


class Runner:
    """Starts ``dvc repro --single-item`` for a stage; the processes share cores and terminal."""

    def __init__(self, root: Path, jobs: int):
        self.root, self.jobs = root, jobs
        self.processes: list[subprocess.Popen] = []

    def __call__(self, stage: str, slot: int, alone: bool) -> subprocess.Popen:
        """The process of a stage, with all cores where nothing else can run beside it, otherwise with its share."""
        share = 1 if alone else self.jobs
        environment = os.environ | {WATCHED: "1"}
        environment.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // share)))
        if sys.stderr.isatty():
            environment["TQDM_POSITION"] = str(slot)  # a line of its own for each progress bar
        command = [sys.executable, "-m", "dvc", "--wait-for-lock", "repro", "--single-item", stage]
        started = guard.start(command, self.root, environment)
        self.processes.append(started)
        return started

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, kind, error, trace) -> None:
        """No stage outlives the run; one that is stopped keeps its checkpoint."""
        for process in self.processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        deadline = time.monotonic() + _GRACE
        for process in self.processes:
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            if process.returncode < 0 or process.returncode > 128:  # killed: its stage may be left
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)


def repro(root: Path, jobs: int) -> list[str]:
    """Brings the pipeline in `root` up to date with at most `jobs` stages at once; returns the stages that failed."""
    wait_for_running(root)
    take_stock(root)
    needs = outdated(root)
    if not needs:
        print("Data and pipelines are up to date.")
        return []

    def hopeless(done: set[str]) -> set[str]:
        """Stages for which the corpus lacks something, once it is there."""
        return set(lacking(root)) & set(needs) if "preprocess" in done or "preprocess" not in needs else set()

    with _delivery(root), Runner(root, jobs) as start:
        failed, left = schedule(needs, start, jobs, _patience(), hopeless)
    if left:
        print(told(lacking(root), left))
    return failed


@contextmanager
def _delivery(root: Path) -> Iterator[None]:
    """Sends to MLflow what stages tell it while the block runs, then what is left; warnings say what stays."""
    command = [sys.executable, "-m", "motionary.pipeline.delivery"]
    # Its standard input ends with this process, however that ends.
    sender = subprocess.Popen([*command, "watch", str(root)], cwd=root, stdin=subprocess.PIPE)
    try:
        yield
    finally:
        assert sender.stdin is not None
        sender.stdin.close()
        try:
            sender.wait(_DELIVERY)
        except subprocess.TimeoutExpired:
            sender.kill()
            sender.wait()


def _patience() -> Callable[[], None]:
    """Waits between two looks; under make it ends this process once make was killed."""
    parent = os.getppid()

    def wait() -> None:
        """One wait."""
        time.sleep(_POLL)
        if "MAKELEVEL" in os.environ and os.getppid() != parent:
            sys.exit(143)

    return wait


@contextmanager
def _stoppable() -> Iterator[None]:
    """SIGINT and SIGTERM end the block, and with it the stages."""
    handlers = {
        signal.SIGTERM: lambda *_: sys.exit(143),
        signal.SIGINT: signal.default_int_handler,  # a shell in the background ignores it, and so would the stages
    }
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(arguments: Sequence[str]) -> int:
    """The command line; exit code 1 where a stage failed, 2 for a bad argument, 130 or 143 where it was stopped."""
    parser = argparse.ArgumentParser(
        prog="python -m motionary.pipeline.repro", description="dvc repro with independent stages side by side"
    )
    cores = os.cpu_count() or 1
    parser.add_argument("--jobs", type=int, default=min(2, cores), help="stages at once (default: %(default)s)")
    options = parser.parse_args(arguments)
    try:
        if options.jobs < 1:
            raise InputError("--jobs", options.jobs, "must be at least 1")
        if not Path("dvc.yaml").exists():
            raise InputError("dvc.yaml", "missing", "run this in the project's root")
        check_params(Path.cwd())
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    from dvc.exceptions import DvcException  # late: it takes a second

    try:
        with _stoppable():
            failed = repro(Path.cwd(), options.jobs)
            if left_in(Path.cwd()):  # of earlier runs, where there was nothing to do, or of one that MLflow failed
                subprocess.run([sys.executable, "-m", "motionary.pipeline.delivery"], check=False)
    except (InputError, DvcException) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; run this again to go on where it was", file=sys.stderr)
        return 130
    if failed:
        print(f"error: {', '.join(failed)} failed; see above, then run this again: what is done stays", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
