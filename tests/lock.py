"""``make lock``: every package that `make setup` may install, with the hashes of all its files on the package index.

requirements.lock holds what runs everywhere; requirements-cuda.lock what the index's build of torch needs on Linux and
its CPU build does not. Versions that are locked stay; --upgrade takes the newest.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CUDA = re.compile(r"(nvidia-|cuda-|triton==)")
# Builds of torch without CUDA, of PyTorch's own index, by hand: wheels for Python 3.11 on x86-64 Linux.
CPU = {"2.13.0": ("6746dbcbeb526eb61330b76b41ff1b4eb848951103a892eeb080dfa2b264667b",)}


def compiled(pinned: str, options: list[str]) -> list[str]:
    """What pyproject.toml asks for, and uv itself, pinned with hashes: a block of lines each."""
    environment = {key: value for key, value in os.environ.items() if key not in ("UV_FIND_LINKS", "PIP_FIND_LINKS")}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "all.lock"
        file.write_text(pinned)
        command = ["uv", "pip", "compile", "pyproject.toml", "-", "--extra", "test", "--python-version", "3.11"]
        command += ["--generate-hashes", "--no-annotate", "--no-header", "-q", "-o", str(file), *options]
        subprocess.run(command, cwd=ROOT, env=environment, input="uv\n", text=True, check=True, stdout=-3)
        return re.split(r"\n(?=\S)", file.read_text().strip())


def with_cpu(block: str) -> str:
    """The block with the hashes of torch's other builds."""
    name, *hashes = block.split(" \\\n")
    more = CPU.get(name.removeprefix("torch=="), ()) if name.startswith("torch==") else ()
    return " \\\n".join([name, *sorted({*hashes, *(f"    --hash=sha256:{digest}" for digest in more)})])


def main(options: list[str]) -> None:
    """Writes both files anew."""
    everywhere, cuda = ROOT / "requirements.lock", ROOT / "requirements-cuda.lock"
    pinned = "".join(file.read_text() for file in (everywhere, cuda) if file.is_file())
    blocks = compiled(pinned, options)
    everywhere.write_text("".join(f"{with_cpu(block)}\n" for block in blocks if not CUDA.match(block)))
    cuda.write_text("".join(f"{block}\n" for block in blocks if CUDA.match(block)))


if __name__ == "__main__":
    main(sys.argv[1:])
