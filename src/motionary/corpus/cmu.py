"""The CMU database with sentences: from public places to a folder that ``data=cmu`` trains on.

Motion is CMU's own (AMC and ASF), sentences are HumanML3D's about it, each with its times, and the database's index has
a phrase for every take. KIT-ML's sentences are left out: they are for research alone, and would bind what is trained.
"""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from motionary.corpus.clips import Caption
from motionary.corpus.downloads import Downloads, read_manifest
from motionary.corpus.released import released_caption
from motionary.errors import InputError
from motionary.files import atomic_file, save_array, write_bytes
from motionary.formats.read.acclaim import read_amc
from motionary.motion import Skeleton, resample, retarget

FPS, SKELETON = 20.0, "smpl22"  # of what is written: HumanML3D's, in whose frames its index counts
SHORTEST = 1.0  # s
_DOWNLOADED, _MOTIONS = "downloads", "motions"


@dataclass(frozen=True)
class Place:
    """A public place of files and the licence that they come under."""

    url: str
    licence: str


PLACES = {
    "cmu": Place("http://mocap.cs.cmu.edu/subjects", "free for all uses, not to be resold as data (mocap.cs.cmu.edu)"),
    "humanml3d": Place("https://raw.githubusercontent.com/EricGuo5513/HumanML3D/main", "MIT"),
    "index": Place("https://raw.githubusercontent.com/una-dinosauria/cmu-mocap/master", "CMU's descriptions, free"),
}
_FILES = {  # file here: place, and path there
    "index.csv": ("humanml3d", "index.csv"),
    "texts.zip": ("humanml3d", "HumanML3D/texts.zip"),
    "cmu-mocap-index-text.txt": ("index", "cmu-mocap-index-text.txt"),
}
README = """# CMU motion capture with sentences

Motion: mocap.cs.cmu.edu, free for all uses, products included; not to be resold as data. "The data used in this project
was obtained from mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217."
Sentences: HumanML3D (Guo et al., CVPR 2022), MIT. Phrases of source cmu-index: CMU's index, compiled by B. Hahne.
downloads/downloads.jsonl has the URL, licence, bytes and SHA-256 of every file that this was made of.
"""


@cache
def known_takes() -> dict[str, Any]:
    """What no file says of takes: those recorded at 60 frames a second, broken ones, and what was published twice."""
    return json.loads(resources.files("motionary.corpus").joinpath("cmu_takes.json").read_text(encoding="utf-8"))


def rate_of(take: str) -> float:
    """Frames per second of a take's AMC file, 120 or 60."""
    known = known_takes()
    take = known["same_take"].get(take, take)
    return 60.0 if take in known["at_60"] or take.split("_")[0] in known["at_60"] else 120.0


def fetch_cmu(
    out: str | Path,
    takes: Sequence[str] | None = None,
    manifest: str | Path | None = None,
    places: dict[str, str] | None = None,
    jobs: int = 4,
    progress: bool = True,
    **retrying: Any,
) -> dict[str, Any]:
    """Obtain and convert takes into the folder `out`; run again, it goes on where it stopped.

    Args:
        out: gets motions/, downloads/, README.md and, once all is there, clips.jsonl.
        takes: names such as "01_01"; None takes all that HumanML3D's or CMU's index has.
        manifest: a ``downloads.jsonl`` whose SHA-256 the files must have (see :class:`Downloads`).
        places: other URLs by the names in `PLACES`, of mirrors.
        jobs: downloads at once.
        progress: show a bar.
        retrying: `attempts` and `wait` of :class:`Downloads`.

    Returns:
        "takes" and "sentences" written, and "problems", an InputError for each take that could not be had or read.

    Raises:
        InputError: an unknown take or place, an index that cannot be had, a file that is not the manifest's, no take.
    """
    if jobs < 1:
        raise InputError("jobs", jobs, "must be at least 1")
    urls = _urls(places or {})
    out = Path(out)
    downloads = Downloads(out / _DOWNLOADED, read_manifest(manifest), **retrying)
    for name, (place, path) in _FILES.items():
        downloads.get(name, f"{urls[place]}/{path}", PLACES[place].licence)
    phrases = _phrases(downloads.folder / "cmu-mocap-index-text.txt")
    lines: list[dict[str, Any]] = []
    problems: list[InputError] = []
    sentences = _sentences(downloads.folder, problems)
    names = _chosen({*phrases, *sentences}, takes)
    for name, problem in _each(names, lambda name: _convert(name, out, downloads, urls["cmu"]), jobs, progress):
        if problem is not None:
            problems.append(problem)
        elif line := _line(out, name, sentences.get(name, []), phrases.get(name, "")):
            lines.append(line)
    if not lines:
        raise InputError(out, "no take", f"at least one must come; the first problem: {(problems or ['none'])[0]}")
    write_bytes(out / "README.md", README)
    write_bytes(out / "clips.jsonl", "".join(json.dumps(line) + "\n" for line in lines))
    return {"takes": len(lines), "sentences": sum(len(line["captions"]) for line in lines), "problems": problems}


def _urls(places: dict[str, str]) -> dict[str, str]:
    for name, url in places.items():
        if name not in PLACES or not url.startswith(("http://", "https://", "file://")):
            raise InputError("places", f"{name}={url}", f"must be a URL of one of {', '.join(PLACES)}")
    return {name: places.get(name, place.url).rstrip("/") for name, place in PLACES.items()}


def _chosen(known: set[str], takes: Sequence[str] | None) -> list[str]:
    """The takes to have, each once, in the order of the database."""
    for name in takes or ():
        if name not in known:
            raise InputError("takes", name, "is in neither index; names are like 01_01")
    facts = known_takes()
    wanted = {facts["same_take"].get(name, name) for name in (known if takes is None else takes)}
    return sorted(wanted - set(facts["left_out"]), key=lambda name: [int(part) for part in name.split("_")])


def _each(
    names: Sequence[str], work: Callable[[str], None], jobs: int, progress: bool
) -> Iterator[tuple[str, InputError | None]]:
    """Every name with what went wrong, in order; an interruption leaves the rest undone."""

    def tried(name: str) -> InputError | None:
        """What went wrong with a name, if anything."""
        try:
            work(name)
        except InputError as problem:
            return problem
        return None

    with ThreadPoolExecutor(jobs) as pool:
        try:
            found = pool.map(tried, names)
            yield from zip(names, tqdm(found, "takes", len(names), unit="take", disable=not progress), strict=True)
        finally:
            pool.shutdown(cancel_futures=True)


def _convert(take: str, out: Path, downloads: Downloads, url: str) -> None:
    """motions/<take>.npy (T, 22, 3) float32 in metres; the take's AMC file is not kept."""
    path, subject = out / _MOTIONS / f"{take}.npy", take.split("_")[0]
    if path.is_file():
        return
    licence = PLACES["cmu"].licence
    asf = downloads.get(f"{subject}.asf", f"{url}/{subject}/{subject}.asf", licence)
    amc = downloads.get(f"{take}.amc", f"{url}/{subject}/{take}.amc", licence)
    try:
        motion = retarget(resample(read_amc(amc, asf, rate_of(take)), FPS), Skeleton.named(SKELETON))
        with atomic_file(path) as temporary:
            save_array(temporary, motion.positions)
    except InputError:
        asf.unlink(missing_ok=True)  # perhaps a page that says that something is wrong: the next run asks again
        raise
    finally:
        amc.unlink(missing_ok=True)


def _line(out: Path, take: str, sentences: Sequence[Caption], phrase: str) -> dict[str, Any] | None:
    """A take's line of clips.jsonl; None for one too short."""
    seconds = len(np.load(out / _MOTIONS / f"{take}.npy", mmap_mode="r")) / FPS
    if seconds < SHORTEST:
        return None
    said = [_timed(caption, seconds) for caption in sentences]
    index = [{"text": phrase, "start": 0.0, "end": seconds, "source": "cmu-index"}] if phrase else []
    subject = take.split("_")[0]
    person = known_takes()["same_people"].get(subject, subject)
    captions = [*filter(None, said), *index]
    return {"motion": f"{_MOTIONS}/{take}.npy", "fps": FPS, "subject": f"cmu-{person}", "captions": captions}


def _timed(caption: Caption, seconds: float) -> dict[str, Any] | None:
    """A sentence as clips.jsonl has it, cut to its take; None where it lies beyond the take's end."""
    start, end = caption.start or 0.0, min(caption.end or seconds, seconds)
    if end <= start:
        return None
    return {"text": caption.text, "start": round(start, 3), "end": round(end, 3), "source": caption.source}


def _phrases(path: Path) -> dict[str, str]:
    """CMU's phrase of every take; lines are ``01_02<tab>climb``, others are headings."""
    rows = (line.split("\t", 1) for line in path.read_text(encoding="utf-8", errors="replace").splitlines())
    found = {row[0].strip(): row[1].strip() for row in rows if len(row) == 2 and _is_take(row[0].strip())}
    return {take: "" if phrase.lower() == "unknown" else phrase for take, phrase in found.items()}


def _is_take(name: str) -> bool:
    subject, _, number = name.partition("_")
    return subject.isdigit() and number.isdigit()


def _sentences(folder: Path, problems: list[InputError]) -> dict[str, list[Caption]]:
    """HumanML3D's sentences by take, in seconds of the take; those about a take's twin are about the take."""
    found: dict[str, list[Caption]] = {}
    twins = known_takes()["same_take"]
    try:
        with zipfile.ZipFile(folder / "texts.zip") as texts, (folder / "index.csv").open(encoding="utf-8") as index:
            files = {Path(name).stem: name for name in texts.namelist() if name.endswith(".txt")}
            for row in csv.DictReader(index):
                take, item = Path(row["source_path"]).stem.removesuffix("_poses"), Path(row["new_name"]).stem
                if "/CMU/" not in row["source_path"] or item not in files or not _is_take(take):
                    continue
                said = _said(texts.read(files[item]).decode("utf-8", "replace"), files[item], problems)
                first, last = int(row["start_frame"]) / FPS, int(row["end_frame"]) / FPS
                found.setdefault(twins.get(take, take), []).extend(_within(caption, first, last) for caption in said)
    except (zipfile.BadZipFile, KeyError, ValueError) as error:
        rule = "index.csv and texts.zip must be HumanML3D's; remove what is not and run again"
        raise InputError(folder, f"{type(error).__name__}: {error}", rule) from None
    return found


def _said(text: str, where: str, problems: list[InputError]) -> Iterator[Caption]:
    """The captions of a file; a bad line becomes a problem."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            try:
                yield released_caption(line, f"{where}:{number}")
            except InputError as problem:
                problems.append(problem)


def _within(caption: Caption, first: float, last: float) -> Caption:
    """A caption of the stretch from `first` to `last` (below 0: to the take's end), with times of the take."""
    end = last if last > 0 else None
    if caption.start is not None and caption.end is not None:
        stop = first + caption.end
        return replace(caption, start=first + caption.start, end=stop if end is None else min(stop, end))
    return replace(caption, start=first, end=end)
