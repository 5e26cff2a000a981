"""The tables of a study: means over seeds, and paired differences with intervals."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motionary.evaluation.style_draws import HELD_OUT
from motionary.metrics.intervals import paired_interval
from motionary.report.results import at
from motionary.report.style_tables import SCORED
from motionary.report.table import NONE, Table, show
from motionary.study.experiments import Experiment, Study


class Measure(NamedTuple):
    """One value of one run, with its 95% interval over the repetitions of the protocol, None where there are none."""

    mean: float
    half: float | None = None


Runs = Mapping[str, Mapping[str, Mapping[str, Measure]]]  # experiment -> system -> metric -> value

_BY = "by the second judge"
_REAL = ("Real R@1", "Real R@3", f"Real R@3 {_BY}")
_HELD = ("Real lengths R@3", "Real lengths FID")
_JOINTS = ("APE root (m)", "APE root, best (m)")
_SECOND = (f"R@3 {_BY}", f"FID {_BY}", f"FID of two real halves {_BY}")
_SLIDING = ("Feet sliding (m/s)", "Feet sliding, planted (m/s)")
_MOVED = (*_HELD, *_JOINTS, "Oracle", "Caption NLL", *_SLIDING)
_GENERATED = ("R@1", "R@2", "R@3", "FID", "FID of two real halves", *_SECOND, *_MOVED)
_CONSENSUS = ("Consensus BLEU-4", "Consensus R@3")
_CAPTIONS = ("BLEU-4", "BLEU-4 raw", "Named action", "Caption R@3", *_CONSENSUS)
_CODES = ("Local MPJPE (mm)", "Codes used")
_STYLED = tuple(
    f"{way}: {heading}"
    for way in ("label-based (S)", "motion-based (S)", "motion-based (U)", "prior-based (U)")
    for heading, key in SCORED
    if key in ("style_accuracy", "content_accuracy", "content_fid", "geodesic", "diversity")
)  # as in thesis Table 5.6
_ACTED = {
    "FID of actions": "fid",
    "Accuracy": "accuracy",
    "Diversity": "diversity",
    "Multimodality": "multimodality",
}  # as in thesis Tables 3.2 and 3.3
_SKATING = "Foot skating (m/s)"
_COMPARED = ("R@1", "R@3", "FID", *_SECOND[:2], *_MOVED, "BLEU-4", "Caption R@3", *_CONSENSUS)


def measured(folder: Path, system: str) -> dict[str, Measure]:
    """The main metrics of one system of one experiment, from its reports.

    Args:
        folder: reports of the experiment (reports/study/<name>).
        system: whose evaluation is read, beside what the system's and the tokenizer's own stages reported.

    Returns:
        {metric: value}; what was not measured is absent. Parts of the data are named behind a comma.
    """
    scored, own = _read(folder / "evaluation" / f"{system}.json"), _read(folder / f"{system}.json")
    tokenizer = own if system == "residual_tokenizer" else _read(folder / "tokenizer.json")
    values: dict[str, Any] = {}
    for keys, prefix, names in (
        (("generation",), "", ("r1", "r2", "r3", "fid", "fid_real_halves")),
        (("real_lengths", "generation"), "Real lengths ", ("r3", "fid")),
        (("captioning",), "Caption ", ("r3",)),
        (("consensus", "captioning"), "Consensus ", ("r3",)),
        (("real",), "Real ", ("r1", "r3")),
    ):
        for part in at(scored, *keys) or {}:
            for name in names:
                values[_named(prefix + _LABELS[name], part)] = at(scored, *keys, part, name)
        second = next(iter((at(scored, *keys, "all", "by") or {}).values()), {})
        values |= {f"{prefix}{_LABELS[name]} {_BY}": second.get(name) for name in names}
    for part in at(scored, "language") or {}:
        values[_named("BLEU-4", part)] = at(scored, "language", part, "bleu4")
        values[_named("BLEU-4 raw", part)] = at(scored, "language", part, "raw", "bleu4")
        values[_named("Consensus BLEU-4", part)] = at(scored, "consensus", "language", part, "bleu4")
    for row, found in (at(own, "style_transfer", HELD_OUT, "rows") or {}).items():
        for heading, key in SCORED:
            values[f"{row}: {heading}"] = at(found, key)
    for sample, errors in (at(scored, "joint_errors", "rows") or {}).items():
        if sample == "one sample" or sample.startswith("best"):
            values[_JOINTS[sample != "one sample"]] = at(errors, "ape_root")
    values["Named action"] = at(scored, "action", "all", "named")
    values["Oracle"] = at(scored, "oracle", "prompts", "confirmed")
    values["Caption NLL"] = at(own, "training", "validation_caption_nll")
    for name, keys in zip(_SLIDING, ((), ("planted",)), strict=True):
        values[name] = at(scored, *keys, "physics", "generated", "foot_skating")
    values["Local MPJPE (mm)"] = at(tokenizer, "positions", "all", "local_mm")
    values["Codes used"] = at(tokenizer, "codes", "used")
    return {name: _measure(value) for name, value in values.items() if value is not None}


def measured_all(folder: Path, systems: Sequence[str]) -> dict[str, dict[str, Measure]]:
    """As :func:`measured`, by system, and of motions of action labels by "system/row", such as
    "action_evaluation/plain"."""
    found = {system: measured(folder, system) for system in systems}
    for system in systems:
        scored = at(_read(folder / f"{system}.json"), "action_generation") or {}
        for row, values in (at(scored, "coarse", "rows") or {}).items():
            skating = at(scored, "physics", row, "foot_skating")
            every = {name: values.get(key) for name, key in _ACTED.items()} | {_SKATING: skating}
            found[f"{system}/{row}"] = {name: _measure(value) for name, value in every.items() if value is not None}
    return found


def _measure(value: Any) -> Measure:
    """Of a number, or of a {"mean", "half"} as reports hold it."""
    return Measure(float(value["mean"]), value.get("half")) if isinstance(value, Mapping) else Measure(float(value))


_LABELS = {"r1": "R@1", "r2": "R@2", "r3": "R@3", "fid": "FID", "fid_real_halves": "FID of two real halves"}


def _named(metric: str, part: str) -> str:
    return metric if part == "all" else f"{metric}, {part}"


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def comparisons(study: Study, runs: Runs) -> list[dict[str, Any]]:
    """Paired differences: for each pair of the study and each metric that both have, over their common values.

    Returns:
        [{"of", "minus", "metric", "pairs", "mean", "half"}]; half is the 95% interval's by Student's t, None for one
        pair.
    """
    out = []
    for (entry_a, system_a), (entry_b, system_b) in study.compare:
        a, b = _by_value(study, runs, entry_a, system_a), _by_value(study, runs, entry_b, system_b)
        common = [value for value in a if value in b]
        names = dict.fromkeys(name for value in common for name in a[value])
        for name in names:
            pairs = [(a[v][name].mean, b[v][name].mean) for v in common if name in a[v] and name in b[v]]
            if pairs:
                found = paired_interval(*np.transpose(pairs))
                half = None if np.isnan(found.half) else round(found.half, 6)
                label = {"of": f"{entry_a} {system_a}", "minus": f"{entry_b} {system_b}", "metric": name}
                out.append({**label, "pairs": len(pairs), "mean": round(found.mean, 6), "half": half})
    return out


def _by_value(study: Study, runs: Runs, entry: str, system: str) -> dict[Any, Mapping[str, Measure]]:
    done = [e for e in study.experiments if e.entry == entry and e.name in runs]
    return {e.value: runs[e.name][system] for e in done if system in runs[e.name]}


def study_tables(study: Study, runs: Runs, found: Sequence[Mapping[str, Any]]) -> list[Table]:
    """The tables of what has been run; empty ones are left out."""
    metrics = {name for run in runs.values() for values in run.values() for name in values}
    parts = sorted({name.split(", ", 1)[1] for name in metrics if ", " in name})
    note = (
        "Mean over seeds (or splits) with its 95% interval by Student's t; of a single run, the interval over the"
        " repetitions of its evaluation (BLEU: over its captions)."
    )

    def with_parts(names: Sequence[str], *of: str) -> list[str]:
        """The names, and some metrics again for each part."""
        return [*names, *(f"{metric}, {part}" for metric in of for part in parts)]

    tables = [
        _means("Text to motion", note, study, runs, with_parts(_GENERATED, "R@3"), "R@1"),
        _means("Motion to text", note, study, runs, with_parts(_CAPTIONS, "BLEU-4"), "BLEU-4"),
        _means("Real motions and the evaluator", note, study, runs, with_parts(_REAL, "Real R@3"), "Real R@1", True),
        _means("Tokens", note, study, runs, _CODES, "Codes used", True),
        _means("Stylization of held-out combinations", note, study, runs, _STYLED, _STYLED[0]),
        _means("Motions of actions", note, study, runs, (*_ACTED, _SKATING), "FID of actions"),
        _differences("Paired differences", found, with_parts(_COMPARED, "R@3")),
        _differences("Paired differences of stylization", found, _STYLED),
        _differences("Paired differences of actions", found, (*_ACTED, _SKATING)),
    ]
    return [table for table in tables if table.rows]


def _means(
    title: str, note: str, study: Study, runs: Runs, names: Sequence[str], needs: str, once: bool = False
) -> Table:
    """A row for each system of each entry that measured `needs`; `once`: for one system of each entry."""
    rows = []
    for entry in dict.fromkeys(e.entry for e in study.experiments):
        done = [e for e in study.experiments if e.entry == entry and e.name in runs]
        known = dict.fromkeys(system for e in done for system in runs[e.name])
        systems = [s for s in known if any(needs in runs[e.name].get(s, {}) for e in done)]
        for system in systems[:1] if once else systems:
            cells = [_mean([runs[e.name].get(system, {}).get(name) for e in done]) for name in names]
            rows.append([entry if once else f"{entry}: {system}", _values(done), *cells])
    kept = [i for i in range(2 + len(names)) if i < 2 or any(row[i] != NONE for row in rows)]
    columns = ["experiment", "runs", *names]
    return Table(title, [columns[i] for i in kept], [[row[i] for i in kept] for row in rows], note)


def _values(done: Sequence[Experiment]) -> str:
    return ", ".join(str(e.value) for e in done) if done[0].value is not None else "1"


def _mean(values: Sequence[Measure | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return NONE
    if len(known) == 1:
        return show(known[0]._asdict())
    found = paired_interval([value.mean for value in known], np.zeros(len(known)))
    return show({"mean": found.mean, "half": found.half})


def _differences(title: str, found: Sequence[Mapping[str, Any]], names: Sequence[str]) -> Table:
    """A row for each pair that has any of these metrics."""
    note = "First minus second with the same seed: mean and 95% interval by Student's t over the seeds."
    pairs = dict.fromkeys((row["of"], row["minus"]) for row in found if row["metric"] in names)
    rows = []
    for of, minus in pairs:
        of_pair = {row["metric"]: row for row in found if (row["of"], row["minus"]) == (of, minus)}
        runs = max(row["pairs"] for row in of_pair.values())
        rows.append([f"{of} - {minus}", str(runs), *(show(of_pair.get(name)) for name in names)])
    kept = [i for i in range(2 + len(names)) if i < 2 or any(row[i] != NONE for row in rows)]
    columns = ["difference", "pairs", *names]
    return Table(title, [columns[i] for i in kept], [[r[i] for i in kept] for r in rows], note)
