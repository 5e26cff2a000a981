"""Batches made ahead of the network that reads them."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Iterator
from typing import TypeVar

import torch

from motionary.corpus.batch import Batch

T = TypeVar("T")
AHEAD = 2  # batches that wait: one is enough unless single ones take long


def ahead(items: Iterator[T], count: int = AHEAD) -> Generator[T, None, None]:
    """The same items in the same order, up to `count` of them made by a thread before they are asked for.

    An exception of `items` is raised where the item that it stands for would have come. Closing the iterator ends the
    thread.
    """
    ready: queue.Queue[tuple[T | None, BaseException | None]] = queue.Queue(count)
    stopped = threading.Event()

    def put(item: T | None, error: BaseException | None = None) -> bool:
        """Whether the item found a place before the reader went away."""
        while not stopped.is_set():
            try:
                ready.put((item, error), timeout=0.1)
            except queue.Full:
                continue
            return True
        return False

    def work() -> None:
        """Makes items until there are none, or nobody wants them."""
        try:
            for item in items:
                if not put(item):
                    return
            put(None, StopIteration())
        except BaseException as error:
            put(None, error)

    worker = threading.Thread(target=work, name="batches", daemon=True)
    worker.start()
    try:
        while True:
            item, error = ready.get()
            if isinstance(error, StopIteration):
                return
            if error is not None:
                raise error
            yield item  # type: ignore[misc]
    finally:
        stopped.set()
        worker.join()


def moved_ahead(batches: Iterator[Batch], device: torch.device) -> Generator[Batch, None, None]:
    """Batches on `device`, made by a thread. For CUDA they lie in pinned memory first, from where the copy overlaps
    what the device still computes."""
    cuda = device.type == "cuda"
    for batch in ahead(batch.pinned() if cuda else batch for batch in batches):
        yield batch.to(device)
