"""Runs stages, two at once: ``python run_stages.py ROOT JOBS.json``, a list of {"name", "command", "log", "needs"}.

Each has a process of its own, forked from this one, where what they load of other projects is there already; "needs"
are the numbers of those that must have ended.
"""

import json
import os
import runpy
import shlex
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from sitecustomize import trace

OTHERS = (
    *("filelock", "hydra", "lightning.fabric", "matplotlib.figure", "matplotlib.backends.backend_agg", "psutil"),
    *("pyarrow.dataset", "pyarrow.parquet", "safetensors.torch", "sklearn", "spacy", "torch", "torch._dynamo"),
    *("transformers.models.bert.modeling_bert", "vector_quantize_pytorch", "yaml"),
)


def run(root: str, job: dict) -> None:
    """Becomes the stage."""
    script, *arguments = shlex.split(job["command"].removeprefix("python "))
    os.environ |= {"DVC_STAGE": job["name"], "TRACE_ROOT": root, "TRACE_LOG": job["log"]}
    sys.argv = [script, *arguments]
    sys.path.insert(0, str(Path(root) / "stages"))
    trace(root, job["log"])
    runpy.run_path(str(Path(root) / script), run_name="__main__")


if __name__ == "__main__":
    folder, jobs = sys.argv[1], json.loads(Path(sys.argv[2]).read_text())
    os.chdir(folder)
    for name in OTHERS:
        with suppress(ModuleNotFoundError):
            import_module(name)
    assert not any(name.startswith("motionary") for name in sys.modules)
    waiting, running, done = list(range(len(jobs))), {}, set()
    while waiting or running:
        for number in [n for n in waiting if done.issuperset(jobs[n]["needs"])][: 2 - len(running)]:
            waiting.remove(number)
            child = os.fork()
            if not child:
                run(folder, jobs[number])
                sys.exit(0)
            running[child] = number
        child, status = os.wait()
        if status:
            sys.exit(f"{jobs[running[child]]['name']} failed")
        done.add(running.pop(child))
