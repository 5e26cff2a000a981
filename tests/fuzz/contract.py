"""What every input must lead to, however it is made: a result, or one line that names it, within time and memory."""

from __future__ import annotations

import json
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from fuzz.limits import MEGABYTES, SECONDS, limited
from fuzz.mutations import KINDS, mutant

from motionary.corpus.preprocess import preprocess
from motionary.corpus.sources import inventory
from motionary.errors import InputError, InputWarning
from motionary.formats import read_motion, write_motion
from motionary.formats.render.video import render_frame
from motionary.formats.rig_files import read_rig
from motionary.language import annotate
from motionary.motion import resample

_BATCH = 40


def check(path: Path, out: Path) -> list[str]:
    """What breaks the contract on a file or a folder: exceptions, warnings, lines without its name, results that
    cannot be read back."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", InputWarning)  # the one that is meant for users
        warnings.filterwarnings("ignore", module=r"(spacy|thinc|torch|click|weasel).*")
        try:
            _folder(path, out) if path.is_dir() else _file(path, out)
        except InputError as error:
            line = str(error)
            named = path.name in line or path.stem in line or (path.is_dir() and "data" in line)
            return [] if named and "\n" not in line else [f"does not name {path.name}: {line}"]
        except Exception as error:
            return [f"{type(error).__name__}: {error}"]
    return []


def _file(path: Path, out: Path) -> None:
    if path.suffix == ".glb":
        with suppress(InputError):  # a file may hold a motion and no character
            read_rig(path)
    motion = read_motion(path)
    written = {}
    for extension in ("npz", "bvh", "glb", "html"):
        written[extension] = write_motion(motion, out / f"{path.stem}.{extension}")
    for extension in ("npz", "bvh"):
        again = read_motion(written[extension])
        if abs(again.frames - motion.frames) > (extension == "bvh"):  # a T-pose in front may be left out
            raise ValueError(f"{extension}: {motion.frames} frames came back as {again.frames}")
    render_frame(motion, width=64, height=64)
    try:
        resample(motion, 30.0)
    except InputError as error:
        raise InputError(f"{path}: {error.what}", error.value, error.rule) from None


def _folder(path: Path, out: Path) -> None:
    kind = "humanml3d" if (path / "new_joints").is_dir() else "folder"
    inventory(path, progress=False)
    settings = {"source": kind, "roots": [str(path)], "workers": 1, "mirror": False, "split": "clip"}
    report = preprocess({**settings, "ratios": [1.0, 0.0, 0.0]}, out / "corpus", progress=False)
    json.dumps(report, allow_nan=False)


def batch(seeds: list[int]) -> dict[int, list[str]]:
    """The faults of these seeds, made and checked in a process of their own. One that dies is blamed on its seed."""
    faults: dict[int, list[str]] = {}
    while seeds:
        outcome = limited(_batch, seeds, seconds=60 + 2 * SECONDS)
        done = [json.loads(line[2:]) for line in outcome.said.splitlines() if line.startswith("@ ")]
        faults.update({seed: found for seed, found in done if found})
        left = [seed for seed in seeds if seed not in {seed for seed, _ in done}]
        if left:
            faults[left[0]] = [f"the process ended ({outcome.code}): {outcome.said.strip()[-300:]}"]
        seeds = left[1:]
    return faults


def _batch(seeds: list[int]) -> None:
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out"
            out.mkdir()
            path = mutant(seed, Path(folder))
            Path("/proc/self/clear_refs").write_text("5")  # from here on the peak of memory is counted anew
            held, started = _megabytes("VmRSS"), time.process_time()
            found = check(path, out)
            seconds = time.process_time() - started
        if seconds > SECONDS:
            found.append(f"{seconds:.1f} s")
        if (more := _megabytes("VmHWM") - held) > MEGABYTES:
            found.append(f"{more:.0f} MB")
        print("@ " + json.dumps([seed, [f"{KINDS[seed % len(KINDS)]}: {fault}" for fault in found]]), flush=True)


def _megabytes(what: str) -> float:
    """That this process holds (VmRSS), or held at most since it last began to count (VmHWM)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{what}:")[1].split()[0]) / 1024


def fuzz(first: int, count: int, seconds: float = float("inf")) -> Iterator[tuple[int, dict[int, list[str]]]]:
    """Batch after batch of the seeds from `first` on: how many were tried, and the faults of those that broke the
    contract."""
    annotate(["a person walks"])  # loads the tagger once, for all forks
    started, tried = time.monotonic(), 0
    while tried < count and time.monotonic() - started < seconds:
        seeds = list(range(first + tried, first + min(tried + _BATCH, count)))
        tried += len(seeds)
        yield len(seeds), batch(seeds)
