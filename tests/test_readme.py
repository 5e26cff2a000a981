"""Every example of the README and of docs/ runs: Python and `motionary` lines as they stand, on untrained models; what
takes long or belongs to the pipeline is held against what it names."""

from __future__ import annotations

import ast
import builtins
import contextlib
import importlib.util
import json
import re
import shlex
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from PIL import Image
from tiny import add_stylizers, add_temos

from motionary.cli.command import build_parser
from motionary.cli.commands import COMMANDS, main
from motionary.corpus.demo import demo_clip
from motionary.corpus.sources import FolderSource

REPOSITORY = Path(__file__).resolve().parents[1]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]
README = PAGES[0].read_text(encoding="utf-8")
TEXT = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


LINES = [line for block in blocks("bash") for line in block.splitlines() if line.strip()]
COMMANDS_SHOWN = [part.strip() for line in LINES for part in line.split("&&")]


@pytest.fixture(scope="module")
def folder(pipeline, tmp_path_factory) -> Path:
    """Where a reader would stand: models, the corpus, and for docs/ recordings and two motions of their own."""
    root = tmp_path_factory.mktemp("readme")
    shutil.copytree(pipeline / "models", root / "models")
    shutil.copytree(pipeline / "data", root / "data")
    add_stylizers(root, root / "models")
    add_temos(root, root / "models")
    for name, index in (("walk.bvh", 3), ("limp.bvh", 4)):
        demo_clip(index)[0].save(root / name)
    write_recordings(root / "recordings")
    return root


def write_recordings(folder: Path, people: int = 12) -> None:
    """A folder of clips, each of another person."""
    folder.mkdir()
    lines = []
    for index in range(people):
        demo_clip(index)[0].save(folder / f"{index}.bvh")
        lines.append(json.dumps({"motion": f"{index}.bvh", "subject": f"person {index}"}))
    (folder / "clips.jsonl").write_text("\n".join(lines) + "\n")


def words(command: str) -> list[str]:
    return shlex.split(command, comments=True)


@pytest.fixture(scope="module")
def names(folder) -> dict:
    """What the Python examples define, run one after the other; their files lie in the folder's out/."""
    styles = sorted(set(re.findall(r'style="(\w+)"', TEXT)) | {"old", "happy"})
    names: dict = {}
    with contextlib.chdir(folder):
        for block in blocks("python"):
            if "d.styles" in block:  # the demo corpus's labels stand for the readers' own
                known = names["d"].styles
                for i, style in enumerate(styles):
                    block = block.replace(f'"{style}"', f'"{known[i % len(known)]}"')
            exec(compile(block, "README.md", "exec"), names)
    return names


def test_python_examples_run_one_after_the_other(folder, names):
    assert len(names["motions"]) == 3
    assert len(names["found"]) == 3
    for picture in ("generated.png", "caption.png", "search.png"):
        assert Image.open(folder / "out" / picture).width > 500


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_first_python_example_of_a_page_imports_and_opens_what_it_uses(page):
    """Whoever comes by a link has run nothing before it."""
    shown = re.search(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    code = ast.parse(shown[1] if shown else "")
    names = [node for node in ast.walk(code) if isinstance(node, ast.Name)]
    made = {name.id for name in names if isinstance(name.ctx, ast.Store)} | set(dir(builtins))
    made |= {a.asname or a.name for n in ast.walk(code) if isinstance(n, ast.Import | ast.ImportFrom) for a in n.names}
    assert {name.id for name in names if isinstance(name.ctx, ast.Load)} <= made


def test_the_readme_reads_and_writes_in_out_alone():
    """So that what an example reads was made by one before it: the folder of these tests has no out/ of its own."""
    shown = "".join(re.findall(r"^```(?:python|bash)\n(.*?)^```", README, re.DOTALL | re.MULTILINE))
    files = re.findall(r"[\w./*-]+\.(?:bvh|npz|npy|glb|mp4|gif|html|png)\b", re.sub(r"#.*", "", shown))
    assert len(files) > 8
    assert [file for file in files if not file.startswith(("out/", "docs/"))] == []
    lines = [words(line) for line in shown.splitlines() if line.startswith("motionary ")]
    folders = [after for line in lines for before, after in pairwise(line) if before in ("--out", "--in", "index")]
    assert len(folders) > 4
    assert all(folder.startswith("out/") for folder in folders)


SHELL = [command for command in COMMANDS_SHOWN if command.startswith("motionary ")]


def test_shell_examples_run_one_after_the_other(folder, names, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    parser, runs = build_parser(COMMANDS), {command.name: command.run for command in COMMANDS}
    import motionary

    known = motionary.load("models").styles[0]
    ran = []
    for command in SHELL:
        given = []
        for word in words(command)[1:]:
            given += sorted(str(p.relative_to(folder)) for p in folder.glob(word)) if "*" in word else [word]
        given = [known if before == "--style" else word for before, word in zip(["", *given], given, strict=False)]
        assert parser.parse_args(given).run is runs[given[0]]
        if given[0] not in ("app", "fetch"):  # served in tests/app, fetched from a local server in tests/corpus
            assert main(given) == 0, f"{command}\n{capsys.readouterr().err}"
        ran.append(given[0])
    assert {"generate", "caption", "stylize", "search", "convert", "export", "view", "app"} <= set(ran)
    assert {path.suffix for path in (folder / "out").iterdir()} >= {".bvh", ".glb", ".mp4"}


@pytest.mark.parametrize("command", [c for c in COMMANDS_SHOWN if not c.startswith("motionary ")])
def test_other_commands_name_what_exists(command):
    given = [word for word in words(command) if not re.fullmatch(r"[A-Z_]+=\S+", word)]
    program, *rest = given
    if program == "make":
        assert re.search(rf"^{rest[0]}:.*##", (REPOSITORY / "Makefile").read_text(), re.MULTILINE), command
    elif program in ("python", "torchrun"):
        script = next((word for word in rest if word.endswith(".py")), None)
        if "-m" in rest and (script is None or rest.index("-m") < rest.index(script)):
            assert importlib.util.find_spec(rest[rest.index("-m") + 1]), command
        assert script is None or (REPOSITORY / script).is_file(), command
        for word in rest:
            if re.fullmatch(r"[a-z_]+\.[a-z_.]+=\S+", word):
                assert _known(word.split("=")[0]), command
    elif program == "dvc":
        for before, word in pairwise(rest):
            if before == "-S":
                assert _known(word.split("=")[0]), command
    else:
        assert program in ("chromium", "."), f"{command}: nothing holds this example"


def _known(key: str) -> bool:
    """Whether conf has this key, or this group."""
    value = yaml.safe_load((REPOSITORY / "params.yaml").read_text())
    if (REPOSITORY / "conf" / key).is_dir():
        return True
    for part in key.split("."):
        if not isinstance(value, dict) or part not in value:
            return False
        value = value[part]
    return True


def test_the_listing_shown_is_one_that_is_read(tmp_path):
    (block,) = blocks("json")
    clip = json.loads(block)
    (tmp_path / clip["motion"]).parent.mkdir()
    demo_clip(3)[0].save(tmp_path / clip["motion"])
    (tmp_path / "clips.jsonl").write_text(json.dumps(clip) + "\n")
    clips, problems = FolderSource(tmp_path, "mine").clips()
    assert not problems
    assert [found.action for found in clips] == ["wave"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pictures_and_links_are_there_and_small(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            path = page.parent / target
            assert path.is_file(), target
            assert path.suffix != ".png" or path.stat().st_size < 200_000, target


def test_the_readme_is_short_and_shows_pictures():
    assert README.count("\n") <= 220
    assert len(re.findall(r"\]\([^)]+\.png\)", README)) >= 4
