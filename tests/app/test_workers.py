"""Work of several visitors at once: what hangs, dies or is heavy harms nobody else, and leaves nothing behind."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import pytest

from motionary.app import work
from motionary.app.turns import Turns
from motionary.app.work import Queue, Workers
from motionary.errors import InputError


def stays() -> bool:
    return True


def refuse(what: str) -> None:
    raise InputError(what, 1, "no")


def die() -> None:
    os._exit(1)


def sleep(seconds: float = 60.0) -> float:
    time.sleep(seconds)
    return seconds


def eat() -> int:
    return len(bytes(2**33))


def fail() -> None:
    raise LookupError("a mistake of ours")


def litter(note: str) -> None:
    """Leaves a file and a program behind, says where, and hangs."""
    folder = tempfile.mkdtemp()
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    Path(note).write_text(f"{folder} {child.pid}")
    time.sleep(60)


QUEUED = ("read", "write")


@pytest.fixture
def workers():
    workers = Workers({"read": Queue(2, 20.0), "write": Queue(2, 20.0), "video": Queue(1, 20.0, 10)})
    yield workers
    workers.close()


def alive(pid: int) -> bool:
    """Whether a process runs, and is not only waiting to be collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def soon(holds, seconds: float = 20.0) -> bool:
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.05)
    return holds()


def test_what_goes_wrong_in_a_process_is_told_and_ends_alone(workers):
    for function, message in ((die, "could not be handled"), (eat, "of memory")):
        with pytest.raises(InputError, match=message):
            workers.in_process("read", stays, function)
    with pytest.raises(InputError, match="thing: 1: no"):
        workers.in_process("read", stays, refuse, "thing")
    with pytest.raises(LookupError, match="a mistake of ours") as caught:
        workers.in_process("read", stays, fail)
    assert "in fail" in "".join(caught.value.__notes__)  # where it happened
    with pytest.raises(RuntimeError, match="cannot be handed on"):
        workers.in_process("read", stays, threading.Lock)
    assert workers.in_process("read", stays, len, "abc") == 3


def test_only_the_job_that_hangs_is_ended():
    """Its neighbour runs on, and those behind it are not charged for the time that they waited."""
    workers = Workers({"read": Queue(2, 5.0)})
    with ThreadPoolExecutor(8) as visitors:
        asked = [visitors.submit(workers.in_process, "read", stays, sleep, seconds) for seconds in (60, 1.4, 1.5, 1.6)]
        assert [job.result(40) for job in asked[1:]] == [1.4, 1.5, 1.6]
        with pytest.raises(InputError, match="took longer than 5 s"):
            asked[0].result(40)
    workers.close()


def test_what_a_visitor_who_leaves_had_running_is_ended_with_all_its_traces(workers, tmp_path):
    gone, note = threading.Event(), tmp_path / "note"
    with ThreadPoolExecutor(2) as visitors:
        running = visitors.submit(workers.in_process, "video", lambda: not gone.is_set(), litter, str(note))
        waiting = visitors.submit(workers.in_process, "video", lambda: not gone.is_set(), sleep)
        assert soon(lambda: note.exists() and " " in note.read_text())
        folder, child = note.read_text().split()
        assert Path(folder).is_dir()
        gone.set()
        for job in (running, waiting):
            with pytest.raises(CancelledError):
                job.result(20)
        assert not Path(folder).exists()
        assert soon(lambda: not alive(int(child)))
        assert workers.in_process("video", stays, len, "abc") == 3
        with pytest.raises(CancelledError):
            workers.on_models(lambda: False, len, "abc")
    assert workers.on_models(stays, len, "abc") == 3


def test_closing_ends_what_runs(tmp_path):
    workers, note = Workers(), tmp_path / "note"
    with ThreadPoolExecutor(1) as visitors:
        job = visitors.submit(workers.in_process, "read", stays, litter, str(note))
        assert soon(lambda: note.exists() and " " in note.read_text())
        workers.close()
        with pytest.raises(CancelledError):
            job.result(20)
    assert soon(lambda: not alive(int(note.read_text().split()[1])))


def test_twenty_light_jobs_do_not_wait_for_another_visitor_s_heavy_one(workers):
    """At the median less than 3 s more than alone, in every queue, while another visitor has each of them busy."""
    light = {queue: lambda queue=queue: workers.in_process(queue, stays, time.sleep, 0.01) for queue in QUEUED}
    light["models"] = lambda: workers.on_models(stays, time.sleep, 0.01)

    def took(job) -> float:
        begin = time.monotonic()
        job()
        return time.monotonic() - begin

    alone = {name: median(took(job) for _ in range(3)) for name, job in light.items()}
    with ThreadPoolExecutor(4) as visitors:
        others = [visitors.submit(workers.in_process, queue, stays, time.sleep, 19) for queue in (*QUEUED, "video")]
        others.append(visitors.submit(workers.on_models, stays, time.sleep, 1))
        beside = {name: median(took(job) for _ in range(20)) for name, job in light.items()}
        assert not any(job.done() for job in others[:3]), "the heavy ones have been at work all the time"
        workers.close()  # they have served
    assert all(beside[name] - alone[name] < 3.0 for name in light), (alone, beside)


def test_models_answer_in_the_order_of_asking(workers):
    order: list[int] = []
    with ThreadPoolExecutor(8) as visitors:
        jobs = []
        for k in range(8):
            jobs.append(visitors.submit(workers.on_models, stays, lambda k=k: (time.sleep(0.05), order.append(k))))
            time.sleep(0.02)
        for job in jobs:
            job.result(20)
    assert order == list(range(8))


def test_too_many_visitors_are_turned_away(workers, monkeypatch):
    monkeypatch.setattr(work, "_MOST_WAITING", 2)
    free, done = threading.Event(), threading.Semaphore(0)

    def job() -> None:
        free.wait(20)
        done.release()

    assert [workers.submit(job) for _ in range(3)] == [True, True, False]
    free.set()
    assert all(done.acquire(timeout=20) for _ in range(2))
    assert soon(lambda: workers.submit(lambda: None))


class Page:
    """What a visitor's turns need of a page; notes are kept."""

    def __init__(self):
        self.gui, self.notes = SimpleNamespace(add_markdown=lambda text: SimpleNamespace(content=text)), []

    def add_notification(self, title: str, text: str, **how) -> None:
        self.notes.append(title)


def test_what_was_delivered_may_be_followed_at_once(workers):
    """The next click may come before the turn of what has just arrived is over; one in the midst of a job is told."""
    page = Page()
    turns = Turns(page, workers)
    delivered, done = threading.Event(), threading.Event()

    def deliver() -> None:
        delivered.set()
        time.sleep(0.3)  # what is left to do once the file has been sent

    turns.start("Writing", deliver)
    assert delivered.wait(10)
    turns.start("Writing", done.set)
    assert done.wait(10)
    assert page.notes == []

    held = threading.Event()
    turns.start("Writing", held.wait)
    turns.start("Writing", done.clear)
    assert page.notes == ["One thing at a time"]
    held.set()
    assert done.is_set()
