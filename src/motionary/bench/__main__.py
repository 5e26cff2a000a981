"""The table of ``make bench``; every case runs in a process of its own, so that its peak memory is its own."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from tqdm import tqdm

from motionary.bench.cases import CASES
from motionary.bench.shapes import SMALL, Shapes
from motionary.bench.workload import Case, clock
from motionary.errors import InputError
from motionary.report.table import NONE, Table

_MATMUL = "matmul"  # measured first, as a child of its own, but no row
_ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS")}


def measure(name: str, shapes: Shapes, repeats: int) -> dict[str, Any]:
    """Runs one case in this process: seconds, runs, peak memory in bytes and a note; or what module is absent."""
    import torch

    from motionary.bench.measure import least_time, matmul_rate, peak_memory

    torch.set_num_threads(1)
    torch.manual_seed(0)
    if name == _MATMUL:
        return {"rate": matmul_rate(shapes.matmul)}
    case = next(case for case in CASES if case.name == name)
    try:
        work = case.prepare(shapes)
    except ModuleNotFoundError as error:
        return {"absent": error.name}
    seconds, runs = least_time(work.run, repeats)
    memory = peak_memory()
    return {"seconds": seconds, "runs": runs, "memory": memory, "note": work.note(seconds)}


def in_child(name: str, small: bool, repeats: int) -> dict[str, Any]:
    """:func:`measure` in a process of its own; a crash becomes its last line."""
    command = [sys.executable, "-m", "motionary.bench", "--child", name, "--repeats", str(repeats)]
    done = subprocess.run(
        command + ["--small"] * small, capture_output=True, text=True, env={**os.environ, **_ONE_THREAD}, check=False
    )
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        return {"failed": (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]}
    return json.loads(lines[-1])


def row(case: Case, result: dict[str, Any]) -> dict[str, Any]:
    """The result beside its reference and bound: "ratio" to the reference, "verdict" ok, over, absent or failed."""
    out = {"name": case.name, "title": case.title, "reference": case.reference, "bound": case.bound, **result}
    if "seconds" not in result:
        return {**out, "verdict": "absent" if "absent" in result else "failed"}
    out["ratio"] = None if case.reference is None else result["seconds"] / case.reference
    out["verdict"] = None if case.bound is None else "ok" if result["seconds"] <= case.bound else "over"
    return out


def table(rows: Sequence[dict[str, Any]], rate: float | None) -> str:
    """Aligned rows, and their notes below."""
    columns = ["case", "CPU time", "reference", "ratio", "bound", "", "peak memory"]
    cells = []
    for found in rows:
        times = [NONE if found.get(k) is None else clock(found[k]) for k in ("seconds", "reference", "bound")]
        ratio = NONE if found.get("ratio") is None else f"{found['ratio']:.2f}"
        memory = f"{found['memory'] / 2**20:.0f} MB" if "memory" in found else NONE
        cells.append([found["title"], times[0], times[1], ratio, times[2], found["verdict"] or NONE, memory])
    notes = [f"{found['name']}: {text}" for found in rows if (text := _note(found))]
    title = "CPU time of one thread" + (f"; matrix products at {rate / 1e9:.1f} GFLOP/s" if rate else "")
    return Table(title, columns, cells).text() + "".join(f"  {note}\n" for note in notes)


def _note(found: dict[str, Any]) -> str:
    if "absent" in found:
        return f"needs {found['absent']}, which is not there"
    return found.get("failed") or found["note"]


def _brief(found: dict[str, Any]) -> str:
    if "seconds" not in found:
        return found["verdict"]
    return f"{clock(found['seconds'])} {found['verdict'] or ''} {found['memory'] / 2**20:.0f} MB {found['note']}"


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
        print(json.dumps(measure(options.child, SMALL if options.small else Shapes(), options.repeats)))
        return 0
    rate = in_child(_MATMUL, options.small, options.repeats).get("rate")
    rows = []
    bar = tqdm(cases, unit="case")
    for case in bar:
        bar.set_description(case.name)
        rows.append(row(case, in_child(case.name, options.small, options.repeats)))
        bar.write(f"{case.name}: {_brief(rows[-1])}", file=sys.stderr)  # a run that is stopped has shown what it has
    print(json.dumps({"matmul_flops_per_second": rate, "cases": rows}, indent=1) if options.json else table(rows, rate))
    return int(any(found["verdict"] == "failed" for found in rows))


if __name__ == "__main__":
    sys.exit(main())
