"""``make kills``: the whole pipeline, killed again and again, must end as if nothing had happened.

A copy of the project on a very small corpus runs once undisturbed. Then, pass after pass from nothing, its run is ended
by SIGKILL at random moments and started again until all stages are done; what a pass leaves is compared with the
undisturbed run to the bit, and nothing half-written and no process may remain. Interrupted, it goes on with its next
kill.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from very_small import REST, SHORT, TRAINED

REPOSITORY = Path(__file__).resolve().parents[1]
COPIED = ("conf", "stages", "src", "data/sources/.gitignore", "dvc.yaml", ".gitignore", ".dvcignore", ".dvc/config")
MADE = (
    "models",
    "reports",
    "data",
    ".cache",
    ".code",
    ".dvc/cache",
    ".dvc/tmp",
    "dvc.lock",
    "mlflow.db",
    "mlartifacts",
)
COMPARED = ("models", "reports", "data/corpus", "data/sources")
LONGEST = 25.0  # seconds until a kill; a stage takes about ten
# Who is killed: the run alone (what it started must end with it), a stage or its DVC alone, or all at once.
VICTIMS = ("run", "stage", "dvc", "all")


class Project:
    """The copy, and its processes."""

    def __init__(self, folder: Path, jobs: int):
        self.folder, self.root, self.jobs = folder, folder / "project", jobs
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self.env = os.environ | {"PATH": path, "PYTHONPATH": str(self.root / "src"), "OMP_NUM_THREADS": "1"}
        self.env.pop("MAKELEVEL", None)

    def create(self) -> None:
        """Copies the project as it is now, with the very small configuration."""
        for name in COPIED:
            self._copy(name)
        micro = {**REST, **{name: values | SHORT for name, values in TRAINED.items()}}
        file = self.root / "conf" / "scale" / "micro.yaml"
        file.write_text(f"# @package _global_\n{json.dumps(micro, indent=1)}\n")
        subprocess.run(["git", "init", "-q"], cwd=self.root, check=True)
        subprocess.run(["git", "add", "."], cwd=self.root, check=True)
        author = ["-c", "user.name=kills", "-c", "user.email=kills@localhost"]
        subprocess.run(["git", *author, "commit", "-qm", "start"], cwd=self.root, check=True)
        overrides = ["scale=micro", "threads=1", *(f"data.{key}={value}" for key, value in REST["data"].items())]
        command = [sys.executable, "-m", "motionary.pipeline.params", "write", *overrides]
        subprocess.run(command, cwd=self.root, env=self.env, check=True)

    def _copy(self, name: str) -> None:
        source, target = REPOSITORY / name, self.root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(source, target)

    def clear(self) -> None:
        """Removes all that a run makes."""
        for name in MADE:
            path = self.root / name
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        self._copy("data/sources/.gitignore")

    def start(self) -> subprocess.Popen:
        """The run that `make repro` starts; what it says goes to a file."""
        command = [sys.executable, "-m", "motionary.pipeline.repro", "--jobs", str(self.jobs)]
        with (self.folder / "log.txt").open("a") as log:
            return subprocess.Popen(command, cwd=self.root, env=self.env, stdin=-3, stdout=log, stderr=log)

    def processes(self) -> list[psutil.Process]:
        """All that works in the project, zombies apart."""
        found = []
        for process in psutil.process_iter():
            try:
                if process.status() != psutil.STATUS_ZOMBIE and Path(process.cwd()).is_relative_to(self.root):
                    found.append(process)
            except (psutil.Error, OSError):
                continue
        return found

    def wait_for_stage(self, run: subprocess.Popen) -> None:
        """Until a stage is at work, or the run has ended."""
        while run.poll() is None:
            lines = (" ".join(_line(process)) for process in self.processes())
            if any(" stages/" in line and "stages/_" not in line for line in lines):
                return
            time.sleep(0.2)

    def kill(self, run: subprocess.Popen, victim: str) -> list[str]:
        """Kills; returns what, as commands. A stage and its DVC are this run's: those that an earlier run left behind
        end by themselves, and this run would not fail with them."""
        lines = [(process, " ".join(_line(process))) for process in self.processes()]
        own = {run.pid, *_children(run.pid)}
        wanted = {
            "run": [pair for pair in lines if pair[0].pid == run.pid],
            "stage": [pair for pair in lines if pair[0].pid in own and " stages/" in pair[1] and "dvc" not in pair[1]],
            "dvc": [pair for pair in lines if pair[0].pid in own and "-m dvc" in pair[1] and "guard.py" not in pair[1]],
            "all": lines,
        }[victim]
        for process, _ in wanted:
            try:
                process.kill()
            except psutil.Error:
                continue
        return [_short(line) for _, line in wanted]

    def results(self) -> dict[str, str]:
        """Hash of every file that is compared."""
        files = [path for name in COMPARED for path in sorted((self.root / name).rglob("*")) if path.is_file()]
        return {str(p.relative_to(self.root)): hashlib.sha256(_undated(p.read_bytes())).hexdigest() for p in files}

    def leftovers(self) -> list[str]:
        """What no finished run may leave."""
        halves = [str(path.relative_to(self.root)) for path in self.root.rglob(".unfinished-*")]
        return halves + [_short(" ".join(_line(process))) for process in self.processes()]


def _undated(content: bytes) -> bytes:
    """A file without the day that the report was made on: passes may take longer than one."""
    return re.sub(rb"<b>date</b> [\w ]+", b"", content)


def _children(pid: int) -> set[int]:
    """Processes below a process."""
    try:
        return {process.pid for process in psutil.Process(pid).children(recursive=True)}
    except psutil.Error:
        return set()


def _line(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def _short(line: str) -> str:
    place = line.find(" stages/")
    return (line[place + 1 :].split(" --config")[0] if place >= 0 else line[-70:]).strip()


def kill_and_go_on(project: Project, record: dict, file: Path, seed: int, most: int, until: float) -> bool:
    """One kill after another until the run ends by itself, well; False where the kills or the time are spent before."""
    while True:
        file.write_text(json.dumps(record, indent=1))
        number = len(record["kills"])
        draw = random.Random(f"{seed}-{number}")
        seconds, victim = draw.uniform(0.0, LONGEST), draw.choice(VICTIMS)
        if number >= most:
            seconds = 3600.0
        elif time.monotonic() + LONGEST > until:
            return False
        run = project.start()
        if draw.random() < 0.8:  # most moments lie among stages; a run prepares itself for a while
            project.wait_for_stage(run)
        try:
            code = run.wait(seconds)
        except subprocess.TimeoutExpired:
            killed = project.kill(run, victim)
            if not killed:  # no such process at that moment
                victim, killed = "all", project.kill(run, "all")
            record["kills"].append({"after": round(seconds, 1), "victim": victim, "killed": killed})
            print(
                f"kill {number + 1}: {victim} after {seconds:.1f} s: {', '.join(killed) or 'nobody there'}", flush=True
            )
            if victim not in ("run", "all"):  # the run notices that a stage has failed, and ends
                run.wait(300)
            run.wait()
            continue
        if code == 0:
            return True
        if not record["kills"]:
            raise SystemExit(f"the run failed by itself, exit code {code}: see {project.folder / 'log.txt'}")
        record["failed"].append(f"after kill {number}: exit code {code}")
        if len(record["failed"]) > 20:
            raise SystemExit(f"runs fail after kills: see {project.folder / 'log.txt'}")


def passes(project: Project, record: dict, file: Path, seed: int, most: int, until: float) -> None:
    """Passes until there were so many kills; each ends with a comparison."""
    while len(record["kills"]) < most or record["open"]:
        if not record["open"]:
            project.clear()
            record["open"] = True
        done = kill_and_go_on(project, record, file, seed, most, until)
        if done:
            found = project.results()
            names = sorted(found.keys() ^ record["results"].keys())
            differ = names + [name for name in found if found[name] != record["results"].get(name, found[name])]
            record["passes"].append({"kills": len(record["kills"]), "differ": differ, "left": project.leftovers()})
            record["open"] = False
            print(f"pass {len(record['passes'])} done: {record['passes'][-1]}", flush=True)
        file.write_text(json.dumps(record, indent=1))
        if not done:
            return


def main() -> int:
    """The command line; exit code 1 where a result differs, something is left, or a run failed by itself."""
    parser = argparse.ArgumentParser(prog="python tests/kills.py", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("--kills", type=int, default=100, help="in all (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the moments and of who is killed")
    parser.add_argument("--jobs", type=int, default=1, help="stages at once")
    parser.add_argument("--minutes", type=float, default=1e6, help="stop after so long; run it again to go on")
    where = Path(tempfile.gettempdir()) / "motionary-kills"
    parser.add_argument("--folder", type=Path, default=where, help="where the copy lies (default: %(default)s)")
    options = parser.parse_args()
    until = time.monotonic() + 60 * options.minutes
    project, file = Project(options.folder, options.jobs), options.folder / "record.json"
    if not file.is_file():
        shutil.rmtree(options.folder, ignore_errors=True)
        project.create()
        if project.start().wait() != 0:
            raise SystemExit(f"the undisturbed run failed: see {options.folder / 'log.txt'}")
        record = {"results": project.results(), "kills": [], "failed": [], "passes": [], "open": False}
        file.write_text(json.dumps(record, indent=1))
    record = json.loads(file.read_text())
    try:
        passes(project, record, file, options.seed, options.kills, until)
    finally:
        for process in project.processes():  # interrupted: what runs goes along
            process.kill()
    bad = [entry for entry in record["passes"] if entry["differ"] or entry["left"]]
    print(
        f"{len(record['kills'])} kills, {len(record['passes'])} passes of {len(record['results'])} files compared, "
        f"{len(bad)} with differences or leftovers, {len(record['failed'])} failures of runs after a kill"
    )
    return int(bool(bad or record["failed"]))


if __name__ == "__main__":
    sys.exit(main())
