"""The table of ``make bench``; every case runs in a process of its own, so that its peak memory is its own.

There, two yardsticks of the machine take turns with it: its cost is what a yardstick does in the same time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tqdm import tqdm

from motionary.bench.cases import CASES
from motionary.bench.shapes import SMALL, Shapes
from motionary.bench.workload import COPIES, PRODUCTS, Case, clock
from motionary.errors import InputError
from motionary.report.table import NONE, Table

_ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS")}


def measure(name: str, shapes: Shapes, repeats: int) -> dict[str, Any]:
    """Runs one case in this process; what module is absent, or seconds, runs, rates of the yardsticks, peak memory in
    bytes without theirs, and a note."""
    import torch

    from motionary.bench.measure import Yardsticks, peak_memory

    torch.set_num_threads(1)
    torch.manual_seed(0)
    case = next(case for case in CASES if case.name == name)
    yardsticks = Yardsticks(shapes.matmul, shapes.copied)  # first, so that a case's own memory is told from theirs
    try:
        work = case.prepare(shapes)
    except ModuleNotFoundError as error:
        return {"absent": error.name}
    timed = yardsticks.beside(work.run, repeats)
    memory, note = peak_memory() - yardsticks.bytes, work.note(timed.seconds)
    if work.gflop:
        rate = work.gflop / timed.seconds
        note += f"{work.gflop:.0f} GFLOP at {rate:.1f} GFLOP/s, {rate / timed.rates[PRODUCTS]:.0%} of the product's"
    return {"seconds": timed.seconds, "runs": timed.runs, "rates": timed.rates, "memory": memory, "note": note}


def in_child(name: str, small: bool, repeats: int, precision: str = "32") -> dict[str, Any]:
    """:func:`measure` in a process of its own; a crash becomes its last line."""
    command = [sys.executable, "-m", "motionary.bench", "--child", name, "--repeats", str(repeats)]
    command += ["--precision", precision]
    done = subprocess.run(
        command + ["--small"] * small, capture_output=True, text=True, env={**os.environ, **_ONE_THREAD}, check=False
    )
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        return {"failed": (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]}
    return json.loads(lines[-1])


def row(case: Case, result: dict[str, Any]) -> dict[str, Any]:
    """The result beside its bound: "cost" in units of the bound's yardstick, "verdict" ok, over, absent or failed."""
    bound = None if case.bound is None else {"amount": case.bound.amount, "unit": case.bound.unit}
    out = {"name": case.name, "title": case.title, "bound": bound, **result}
    if "seconds" not in result:
        return {**out, "verdict": "absent" if "absent" in result else "failed"}
    if case.bound is None:
        return {**out, "cost": None, "verdict": None}
    out["cost"] = result["seconds"] * result["rates"][case.bound.unit]
    return {**out, "verdict": "ok" if out["cost"] <= case.bound.amount else "over"}


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Aligned rows, and their notes below."""
    columns = ["case", "CPU time", "cost", "bound", "", "peak memory"]
    cells = []
    for found in rows:
        time = clock(found["seconds"]) if "seconds" in found else NONE
        cost, bound = (_amount(found, value) for value in (found.get("cost"), (found["bound"] or {}).get("amount")))
        memory = f"{found['memory'] / 2**20:.0f} MB" if "memory" in found else NONE
        cells.append([found["title"], time, cost, bound, found["verdict"] or NONE, memory])
    notes = [f"{found['name']}: {text}" for found in rows if (text := _note(found))]
    title = "CPU time of one thread, and its cost: what a yardstick did in the same time"
    return Table(title, columns, cells).text() + "".join(f"  {note}\n" for note in [*notes, *_speeds(rows)])


def _amount(found: dict[str, Any], value: float | None) -> str:
    if value is None:
        return NONE
    return f"{value:,.0f} {found['bound']['unit']}" if value >= 100 else f"{value:.3g} {found['bound']['unit']}"


def _speeds(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The yardsticks of all cases, slowest and fastest."""
    units = {unit for found in rows for unit in found.get("rates", {})}
    speeds = {unit: [found["rates"][unit] for found in rows if "rates" in found] for unit in sorted(units)}
    what = {PRODUCTS: "matrix products", COPIES: "memory copies"}
    return [f"{what[unit]}: {min(speed):.1f} to {max(speed):.1f} {unit}/s" for unit, speed in speeds.items()]


def _note(found: dict[str, Any]) -> str:
    if "absent" in found:
        return f"needs {found['absent']}, which is not there"
    return found.get("failed") or found["note"]


def _brief(found: dict[str, Any]) -> str:
    if "seconds" not in found:
        return found["verdict"]
    cost = f"{_amount(found, found['cost'])} {found['verdict'] or ''}"
    return f"{clock(found['seconds'])} {cost} {found['memory'] / 2**20:.0f} MB {found['note']}"


def _chosen(only: str | None) -> list[Case]:
    if only is None:
        return list(CASES)
    names = [name.strip() for name in only.split(",")]
    known = {case.name: case for case in CASES}
    for name in names:
        if name not in known:
            raise InputError("--only", name, f"must be among {', '.join(known)}")
    return [known[name] for name in names]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures the chosen cases and prints the table; exit code 1 where a case crashed, 2 on bad arguments."""
    parser = argparse.ArgumentParser(prog="python -m motionary.bench", description=__doc__)
    parser.add_argument("--only", metavar="NAME,...", help="these cases: " + ", ".join(case.name for case in CASES))
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each case, the shortest counts (default 5)")
    parser.add_argument(
        "--precision", choices=("32", "bf16-mixed"), default="32", help="of training steps (bounds are those of 32)"
    )
    parser.add_argument("--small", action="store_true", help="tiny shapes, only to see that every case runs")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    try:
        if options.repeats < 1:
            raise InputError("--repeats", options.repeats, "must be at least 1")
        cases = _chosen(options.only)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if options.child:
        shapes = replace(SMALL if options.small else Shapes(), precision=options.precision)
        print(json.dumps(measure(options.child, shapes, options.repeats)))
        return 0
    rows = []
    bar = tqdm(cases, unit="case")
    for case in bar:
        bar.set_description(case.name)
        rows.append(row(case, in_child(case.name, options.small, options.repeats, options.precision)))
        bar.write(f"{case.name}: {_brief(rows[-1])}", file=sys.stderr)  # a run that is stopped has shown what it has
    print(json.dumps({"cases": rows}, indent=1) if options.json else table(rows))
    return int(any(found["verdict"] == "failed" for found in rows))


if __name__ == "__main__":
    sys.exit(main())
