"""What one visitor's video of a minute costs another: ``python -m motionary.bench.visitors``.

Files are read and written as the page does it, twenty times alone and twenty times while another visitor's videos are
made; one visitor must not delay another by more than three seconds at the median.
"""

from __future__ import annotations

import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from pathlib import Path

from motionary.app.limits import MOST_VIDEO
from motionary.app.work import Workers, file_bytes, read_upload
from motionary.corpus.demo import demo_clip
from motionary.errors import InputError
from motionary.motion import Motion
from motionary.report.table import Table

ASKED, BOUND = 20, 3.0  # times each; seconds


def median(job: Callable[[], object], times: int) -> float:
    """Median seconds of a job."""
    taken = []
    for _ in range(times):
        start = time.monotonic()
        job()
        taken.append(time.monotonic() - start)
    return statistics.median(taken)


def measure(times: int = ASKED) -> dict[str, tuple[float, float]]:
    """Median seconds of reading and of writing a file, alone and beside another visitor's videos."""
    workers, done = Workers(), threading.Event()
    short = demo_clip(3)[0]
    long = Motion(short.positions.repeat(1 + int(MOST_VIDEO / short.duration), axis=0), short.fps, short.skeleton)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "short.bvh"
        short.save(path)
        content = path.read_bytes()
    jobs = {
        "read a BVH": lambda: workers.in_process("read", lambda: True, read_upload, "short.bvh", content),
        "write a glb": lambda: workers.in_process("write", lambda: True, file_bytes, short, ".glb", ""),
    }

    def heavy() -> None:
        """One video after the other, until the page closes."""
        while not done.is_set():
            try:
                workers.in_process("video", lambda: not done.is_set(), file_bytes, long, ".mp4", "")
            except InputError:  # took longer than a video may
                continue
            except CancelledError:
                return

    try:
        alone = {name: median(job, times) for name, job in jobs.items()}
        threading.Thread(target=heavy, daemon=True).start()
        time.sleep(1)  # until its process is at work
        return {name: (alone[name], median(job, times)) for name, job in jobs.items()}
    finally:
        done.set()
        workers.close()


def main() -> None:
    """Prints the table."""
    rows = [
        [name, f"{alone:.2f}", f"{beside:.2f}", "ok" if beside - alone <= BOUND else f"over {BOUND:g} s more"]
        for name, (alone, beside) in measure().items()
    ]
    columns = ["median of 20, s", "alone", "beside another's videos", "verdict"]
    print(Table("What a visitor waits for", columns, rows).text(), end="")


if __name__ == "__main__":
    main()
