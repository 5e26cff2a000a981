"""The result tables: one row per system, whatever systems there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from motionary.report.caption_tables import WORDED, motion_to_text
from motionary.report.results import VARIANTS, Results, at, parts_of, with_variants
from motionary.report.table import NONE, Table, percent, show
from motionary.report.verdicts import judges_of

JUDGED = (
    ("R@1", "r1"),
    ("R@2", "r2"),
    ("R@3", "r3"),
    ("FID", "fid"),
    ("FID of two real halves", "fid_real_halves"),
    ("MM distance", "mm_dist"),
    ("Diversity", "diversity"),
)


def text_to_motion(results: Results, part: str = "all", judge: str | None = None) -> Table | None:
    """Generated motions judged with their captions, real ones above them, reconstructed ones between.

    Args:
        results: of the pipeline.
        part: of the test split.
        judge: the one whose rows are shown; None is the first.
    """
    systems = {n: r for n, r in results.having("generation").items() if part in r["generation"]}
    decoded = {n: r for n, r in results.having("reconstruction").items() if part in r["reconstruction"]}
    if not systems and not decoded:
        return None
    whole = part == "all"
    first = next(iter((systems or decoded).values()))
    extra = ["Multimodality", "Oracle: captions", "Oracle: prompts", "Foot skating, m/s"] if whole else ["Oracle"]

    def row(label: str, judged: Any, *more: str) -> list[str]:
        """A row of judged metrics and what else there is."""
        own = judged if judge is None else at(judged, "by", judge)
        cells = [show(at(own, key)) for _, key in JUDGED]
        return [label, *cells, *more, *[NONE] * (len(extra) - len(more))]

    real_oracle = percent(at(first, "oracle", "captions_real", part, "confirmed"))
    skating = show(at(first, "physics", "real", "foot_skating"))
    real_more = (NONE, real_oracle, NONE, skating) if whole else (real_oracle,)
    rows = [row("real motions", at(first, "real", part), *real_more)]
    chance = at(first, "oracle", "captions_chance", part, "confirmed")
    if chance is not None:
        rows.append(row("other real motions, drawn", None, *([NONE] * whole), percent(chance)))
    for name, report in decoded.items():
        captions = percent(at(report, "reconstruction_oracle", part, "confirmed"))
        rows.append(row(f"real, through {name}", report["reconstruction"][part], *([NONE] * whole), captions))
    for name, report in with_variants(systems, "real_lengths", "planted").items():
        captions = percent(at(report, "oracle", "captions", part, "confirmed"))
        more = (
            show(report.get("multimodality") if judge is None else at(report, "multimodality", "by", judge)),
            captions,
            percent(at(report, "oracle", "prompts", "confirmed")),
            show(at(report, "physics", "generated", "foot_skating")),
        )
        rows.append(row(name, report["generation"][part], *(more if whole else (captions,))))
    judged = (first.get("generation") or first["reconstruction"])[part]
    note = f"{judged['items']} test motions, R-precision in pools of {judged['pool']}; ± is the 95% interval."
    title = ": ".join(("Text to motion", *([] if whole else [part]), *([f"by {judge}"] if judge else [])))
    return Table(title, ["", *(heading for heading, _ in JUDGED), *extra], rows, note)


def parts_tables(results: Results) -> list[Table]:
    """Both result tables for each part of the test split: every root, human-written and template captions."""
    tables = []
    for key, make in (("generation", text_to_motion), ("language", motion_to_text)):
        for part in parts_of(results.having(key), key):
            if part != "all":
                tables += [table for table in (make(results, part), *by_other_judges(results, part, make)) if table]
    return tables


def by_other_judges(
    results: Results, part: str = "all", make: Callable[..., Table | None] = text_to_motion
) -> list[Table]:
    """The table of generation by each judge beyond the first; tables of captions have them as columns."""
    made = [make(results, part, judge) for judge in judges_of(results)] if make is text_to_motion else []
    return [table for table in made if table is not None]


def reconstruction(results: Results) -> Table | None:
    """Position errors of motions encoded and decoded again."""
    reports = {**{n: r for n, r in results.stages.items() if "positions" in r}, **results.having("positions")}
    rows = []
    for name, report in reports.items():
        codes = report.get("codes", at(results.stages, name, "codes"))
        for part, values in report["positions"].items():
            errors = [show(values.get(f"{kind}_mm"), 1) for kind in ("local", "root", "global")]
            rows.append([name, part, show(values.get("windows")), *errors, percent(at(codes, "used"))])
    if not rows:
        return None
    columns = ["", "part", "windows", "local pose, mm", "root removed, mm", "global, mm", "codes used"]
    note = "Mean distance of joints. Local: root and heading removed; global: nothing removed."
    return Table("Motions through a codec", columns, rows, note)


def nearest_training(results: Results) -> Table | None:
    """How near generated motions lie to training motions: a system that copies shows here."""
    rows: list[list[str]] = []
    for name, report in results.having("nearest_training").items():
        found = report["nearest_training"]
        if not rows:
            rows.append(["real motions", *_distances(found.get("real"))])
        rows.append([name, *_distances(found.get("generated"))])
    note = "Distance in the space that is searched, from each motion to the nearest training motion; zero is a copy."
    return Table("Nearest training motion", ["", "mean", "least"], rows, note) if rows else None


def prompts(results: Results) -> Table | None:
    """The oracle's verdict on each of its prompts."""
    each = {n: found for n in results.systems if (found := at(results.systems[n], "oracle", "prompts", "each"))}
    texts = list(dict.fromkeys(text for found in each.values() for text in found))
    if not texts:
        return None
    rows = [[text, *(percent(found.get(text)) for found in each.values())] for text in texts]
    note = "Share of motions generated for a prompt that a geometric reading of side, direction and speed confirms."
    return Table("Prompts that can be checked against truth", ["prompt", *each], rows, note)


def training(results: Results) -> Table | None:
    """What each training stage reported of its curves; a stage may train several models."""
    keys = ("steps", "best_step", "best_validation_loss")
    rows = [
        [name if model == "training" else f"{name}: {model}", *(show(found.get(key), 4) for key in keys)]
        for name, report in results.stages.items()
        for model, found in report.items()
        if isinstance(found, Mapping) and "best_step" in found
    ]
    return Table("Training", ["stage", "steps", "best step", "best validation loss"], rows) if rows else None


def lengths(results: Results) -> Table | None:
    """Lengths predicted from text, beside the histogram of training lengths that does not read it."""
    rows = []
    for name, report in results.stages.items():
        for part, found in (at(report, "lengths") or {}).items():
            for label, key in ((name, "model"), ("histogram", "histogram")):
                shares = [percent(at(found, key, near)) for near in ("within_1", "within_3")]
                rows.append([label, part, show(found["items"]), *shares, show(at(found, key, "nll"))])
    note = "Share of captions whose likeliest length is near the true one; the likelihood of the true one, in nats."
    columns = ["", "part", "captions", "within 1 unit", "within 3 units", "negative log-likelihood"]
    return Table("Lengths from text", columns, rows, note) if rows else None


def summary(results: Results) -> dict[str, dict[str, float]]:
    """{system: {metric: mean}} of the main tables: reports/summary.json."""
    out: dict[str, dict[str, float]] = {}

    def put(name: str, metric: str, value: Any) -> None:
        """Keeps a value that is there."""
        value = value.get("mean") if isinstance(value, Mapping) else value
        if value is not None:
            out.setdefault(name, {})[metric] = value

    for name, report in with_variants(results.systems, *VARIANTS).items():
        for key in ("generation", "reconstruction"):
            for _, metric in JUDGED:
                put("real", metric, at(report, "real", "all", metric) if key in report else None)
                put(name, metric, at(report, key, "all", metric))
            for judge in judges_of(results):
                for metric in ("r3", "fid"):
                    put(
                        "real",
                        f"{metric}_{judge}",
                        at(report, "real", "all", "by", judge, metric) if key in report else None,
                    )
                    put(name, f"{metric}_{judge}", at(report, key, "all", "by", judge, metric))
        put(name, "multimodality", report.get("multimodality"))
        put(name, "oracle_captions", at(report, "oracle", "captions", "all", "confirmed"))
        put(name, "oracle_prompts", at(report, "oracle", "prompts", "confirmed"))
        for metric, value in (at(report, "physics", "generated") or {}).items():
            put(name, metric, value)
        for metric, value in (at(report, "physics", "real") or {}).items():
            put("real", metric, value)
        for _, metric in WORDED:
            put(name, metric, at(report, "language", "all", metric))
        put(name, "caption_r3", at(report, "captioning", "all", "r3"))
        put(name, "action_named", at(report, "action", "all", "named"))
    for name, report in {**results.stages, **results.systems}.items():
        for kind in ("local", "global"):
            put(name, f"{kind}_mm", at(report, "positions", "all", f"{kind}_mm"))
        put(name, "codes_used", at(report, "codes", "used"))
        for metric in ("within_1", "within_3", "nll"):
            put(name, f"length_{metric}", at(report, "lengths", "all", "model", metric))
        for part, found in (at(report, "style_transfer") or {}).items():
            for row, metric in ((row, metric) for row, values in found["rows"].items() for metric in values):
                put(f"{part}: {row}", metric, found["rows"][row][metric])
        for metric in ("style", "content"):
            put(name, f"{metric}_accuracy", at(report, "real", metric))
    return out


def _distances(found: Any) -> list[str]:
    return [show(at(found, "mean")), show(at(found, "least"))]
