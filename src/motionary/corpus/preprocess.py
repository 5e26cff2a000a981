"""From sources to a corpus folder: every clip once, in parallel, with memory that does not grow with the frames."""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from motionary.corpus.clips import Caption, Clip, problem_rows
from motionary.corpus.config import DataConfig
from motionary.corpus.context import Context
from motionary.corpus.readings import ReadingCounts
from motionary.corpus.shared_rigs import with_shared_rigs
from motionary.corpus.sources import Source, open_sources
from motionary.corpus.splits import SPLITS, split_clips
from motionary.corpus.store import CAPTION_SCHEMA, CLIP_SCHEMA, MIRROR
from motionary.corpus.tagging import tagged
from motionary.corpus.tally import Tally
from motionary.corpus.windows import Rule, Window
from motionary.corpus.workers import Encoded, Recipe, clip_labels, encode_clip, in_order
from motionary.corpus.writing import FrameWriter, RunningStatistics, group_deviation
from motionary.errors import InputError
from motionary.features import UNIT, codec
from motionary.files import atomic_folder, list_files, save_array
from motionary.language import Sentence, Vocabulary, mirror_text, sentence_from_tokens
from motionary.motion import Skeleton


def preprocess(
    config: DataConfig | Mapping[str, Any], out: str | Path, root: str | Path = ".", progress: bool = True
) -> dict[str, Any]:
    """Build a corpus folder that `Corpus.open` reads; the result does not depend on the number of workers.

    Args:
        config: the `data` section.
        out: the folder; it appears complete or not at all, and replaces what was there.
        root: where relative data roots start.
        progress: show bars.

    Returns:
        The report, also written as report.json: what was read, kept and dropped, and every problem.

    Raises:
        InputError: no usable clip, or with `config.strict` the first problem.
    """
    if not isinstance(config, DataConfig):
        config = DataConfig.from_mapping(config)
    sources = open_sources(config, root)
    workers = config.workers or os.cpu_count() or 1
    clips, problems = _list_clips(sources, config.strict)
    clips = with_shared_rigs([_without(clip, config.source_weights) for clip in clips], workers)
    if config.source == "demo" and config.split in ("combination", "subject"):
        # The demo's labels come with its motions, and these splits need them first.
        clips = list(_bar(in_order(clip_labels, [(clip,) for clip in clips], workers), clips, "labels", progress))
    splits = split_clips(clips, config.split, config.ratios, config.seed)
    lengths = config.fps, config.min_seconds, config.max_seconds, UNIT
    rule = Rule(*lengths, config.cut, config.least_cover, config.seed)
    recipe = Recipe(config.skeleton, config.codec, rule, config.mirror)
    jobs = [(clip, splits[clip.id], recipe) for clip in clips]
    with atomic_folder(Path(out)) as folder:
        build = _Build(folder, config, rule, problems, f"{root}/")
        for (_, split, _), encoded in zip(
            jobs, _bar(in_order(encode_clip, jobs, workers), clips, "preprocess", progress), strict=True
        ):
            build.add(encoded, split)
        return build.finish(progress)


def _list_clips(sources: Sequence[Source], strict: bool) -> tuple[list[Clip], list[InputError]]:
    clips: dict[str, Clip] = {}
    problems = []
    for source in sources:
        found, wrong = source.clips()
        for clip in found:
            if clip.id in clips:
                wrong.append(InputError(clip.where, clip.id, f"duplicate id, first seen at {clips[clip.id].where}"))
            else:
                clips[clip.id] = clip
        problems += wrong
        if strict and problems:
            raise problems[0]
    if not clips:
        hint = f"; the first problem: {problems[0]}" if problems else ""
        raise InputError("data.roots", "no clip", f"sources must list at least one usable clip{hint}")
    return list(clips.values()), problems


def _without(clip: Clip, weights: Mapping[str, float]) -> Clip:
    """The clip without captions of sources that weigh nothing: where no other is left, it trains what reads no text."""
    captions = tuple(caption for caption in clip.captions if weights.get(caption.source, 1.0) > 0)
    return clip if len(captions) == len(clip.captions) else replace(clip, captions=captions)


def _bar(results: Iterator, clips: Sequence[Clip], name: str, progress: bool) -> Iterable:
    return tqdm(results, total=len(clips), desc=name, unit="clip", disable=not progress)


@dataclass
class _Build:
    """A corpus while it is being written."""

    folder: Path
    config: DataConfig
    rule: Rule
    problems: list[InputError]
    prefix: str  # not shown in file names of the report, which must not depend on where the project lies
    rows: list[dict] = field(default_factory=list)
    captions: list[tuple[int, Caption, str]] = field(default_factory=list)  # row, caption, text
    dropped: Counter = field(default_factory=Counter)
    read: Counter = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    readings: defaultdict[str, ReadingCounts] = field(default_factory=lambda: defaultdict(ReadingCounts))

    def __post_init__(self):
        self.skeleton = Skeleton.named(self.config.skeleton)
        self.codec = codec(self.config.codec, self.skeleton)
        self.frames = FrameWriter(self.folder / "frames.npy", self.codec.dim)
        self.statistics = RunningStatistics(self.codec.dim)
        self.tally = Tally(self.config.fps)

    def add(self, encoded: Encoded, split: str) -> None:
        """Take in one clip; with `strict` its first problem ends everything."""
        if self.config.strict and encoded.problems:
            raise encoded.problems[0]
        self.problems += encoded.problems
        self.dropped += encoded.dropped
        self.tally.add(encoded, split)
        self.read[encoded.clip.group] += 1
        self.seconds[encoded.clip.group] += encoded.seconds
        if encoded.clip.reading is not None:
            self.readings[encoded.clip.group].add(encoded.clip.reading, encoded.clip.where.replace(self.prefix, ""))
        several = len(encoded.windows) > 1
        for k, (window, features, flipped) in enumerate(encoded.windows):
            name = f"{encoded.clip.id}#{k}" if several else encoded.clip.id
            self._row(name, encoded.clip, split, window, features, encoded.clip.mirrored)
            self.captions += [(len(self.rows) - 1, caption, caption.text) for caption in window.captions]
            if flipped is not None:
                self._row(f"{name}{MIRROR}", encoded.clip, split, window, flipped, True)
                texts = [(caption, mirror_text(caption.text)) for caption in window.captions]
                self.captions += [(len(self.rows) - 1, caption, text) for caption, text in texts]

    def _row(self, name: str, clip: Clip, split: str, window: Window, features: np.ndarray, mirrored: bool) -> None:
        if split == "train":
            self.statistics.update(features)
        self.rows.append(
            {
                "id": name,
                "offset": self.frames.append(features),
                "length": len(features),
                "split": split,
                "subject": clip.subject,
                "style": clip.style,
                # A wave with the left hand, mirrored, is one with the right.
                "action": mirror_text(clip.action) if mirrored and not clip.mirrored else clip.action,
                "mirrored": mirrored,
                "origin": clip.origin,
                "start": window.start,
                "end": window.end,
                "group": clip.group,
                "attributes": "" if mirrored else clip.attributes,
            }
        )

    def finish(self, progress: bool) -> dict[str, Any]:
        """Write tables, statistics, vocabulary, context and report; returns the report."""
        digests = [self.frames.close()]
        self._check()
        sentences = self._sentences(progress)
        kept = [(*caption, sentence) for caption, sentence in zip(self.captions, sentences, strict=True)]
        for _, caption, text, sentence in kept:
            if not sentence.words:
                self.problems.append(InputError(caption.source or "caption", text, "has no word left"))
        kept = [entry for entry in kept if entry[3].words]
        self._write_tables(kept)
        self._write_context([entry[3] for entry in kept if self.rows[entry[0]]["split"] == "train"])
        for name in ("clips.parquet", "captions.parquet", "context.json"):
            digests.append(hashlib.sha256((self.folder / name).read_bytes()).hexdigest())
        report = self._report(kept) | {"hash": hashlib.sha256("".join(digests).encode()).hexdigest()}
        (self.folder / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        list_files(self.folder)
        return report

    def _check(self) -> None:
        hint = f"; the first problem: {self.problems[0]}" if self.problems else ""
        if not self.rows:
            reasons = ", ".join(f"{reason}: {count}" for reason, count in sorted(self.dropped.items()))
            raise InputError("data", f"no usable clip ({reasons})", f"at least one clip must remain{hint}")
        if not any(row["split"] == "train" for row in self.rows):
            raise InputError("data.ratios", list(self.config.ratios), f"leave no window for training{hint}")

    def _sentences(self, progress: bool) -> list[Sentence]:
        """Each caption normalized and tagged; a release's own tagged words are kept, but not for mirrored texts."""
        workers = self.config.workers or os.cpu_count() or 1
        known, wrong = tagged([text for _, _, text in self.captions], workers, progress)
        self.problems += wrong
        return [
            sentence_from_tokens(text, caption.tokens) if caption.tokens and text == caption.text else known[text]
            for _, caption, text in self.captions
        ]

    def _write_tables(self, kept: list[tuple[int, Caption, str, Sentence]]) -> None:
        table = pa.Table.from_pylist(self.rows, CLIP_SCHEMA)
        pq.write_table(table, self.folder / "clips.parquet", write_page_checksum=True)
        keys = {text: i for i, text in enumerate(sorted({" ".join(entry[3].words) for entry in kept}))}
        captions = [
            {
                "clip": row,
                "text": text,
                "words": list(sentence.words),
                "tags": list(sentence.tags),
                "key": keys[" ".join(sentence.words)],
                "source": caption.source,
                "human": caption.human,
                "weight": self.config.source_weights.get(caption.source, 1.0),
            }
            for row, caption, text, sentence in kept
        ]
        table = pa.Table.from_pylist(captions, CAPTION_SCHEMA)
        pq.write_table(table, self.folder / "captions.parquet", write_page_checksum=True)

    def _write_context(self, training: list[Sentence]) -> None:
        vocabulary = Vocabulary.build(training, min_count=self.config.min_count)
        context = Context(
            skeleton=self.skeleton,
            fps=self.config.fps,
            codec=self.config.codec,
            unit=UNIT,
            mean=self.statistics.mean.astype(np.float32),
            std=group_deviation(self.statistics.deviation(), self.codec.slices),
            vocabulary=vocabulary,
            max_frames=self.rule.max_frames,
            styles=tuple(sorted({row["style"] for row in self.rows} - {""})),
            actions=tuple(sorted({row["action"] for row in self.rows} - {""})),
        )
        save_array(self.folder / "mean.npy", context.mean)
        save_array(self.folder / "std.npy", context.std)
        (self.folder / "vocabulary.json").write_text(json.dumps(vocabulary.to_json()) + "\n", encoding="utf-8")
        context.save(self.folder / "context.json")

    def _report(self, kept: list[tuple[int, Caption, str, Sentence]]) -> dict[str, Any]:
        captioned = {entry[0] for entry in kept}
        groups: dict[str, dict[str, Any]] = defaultdict(Counter)
        for i, row in enumerate(self.rows):
            for counts in (groups["all"], groups[f"split {row['split']}"], groups[f"root {row['group']}"]):
                counts["windows"] += 1
                counts["mirrored"] += row["mirrored"]
                counts["captioned"] += i in captioned
                counts["minutes"] += row["length"] / self.config.fps / 60
        rounded = {
            name: {key: round(value, 3) if key == "minutes" else value for key, value in counts.items()}
            for name, counts in groups.items()
        }
        used = {(row["group"], row["id"].split("#")[0].split("@")[0]) for row in self.rows}
        return {
            "name": self.config.name,
            "source": self.config.source,
            "read": sum(self.read.values()),
            "kept": len(used),
            "minutes_read": round(sum(self.seconds.values()) / 60, 3),
            "dropped": dict(sorted(self.dropped.items())),
            "total": rounded.get("all", {}),
            "splits": {split: rounded.get(f"split {split}", {}) for split in SPLITS},
            "roots": {
                name: {"read": self.read[name], "minutes_read": round(self.seconds[name] / 60, 3)}
                | rounded.get(f"root {name}", {})
                | ({"reading": self.readings[name].report()} if name in self.readings else {})
                for name in sorted(self.read)
            },
            "captions": len(kept),
            **self.tally.report(),
            "problem_count": len(self.problems),
            "problems": problem_rows(self.problems, self.prefix),
        }
