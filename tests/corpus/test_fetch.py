"""CMU's takes from public places: a local server that breaks off, refuses and counts stands for them."""

from __future__ import annotations

import io
import json
import threading
import zipfile
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from acclaim_files import amc, asf

from motionary.cli.commands import main
from motionary.corpus.cmu import fetch_cmu, rate_of
from motionary.corpus.preprocess import preprocess
from motionary.errors import InputError

INDEX = """source_path,start_frame,end_frame,new_name
./pose_data/CMU/01/01_01_poses.npy,20,60,000001.npy
./pose_data/CMU/64/64_01_poses.npy,0,-1,000002.npy
./pose_data/KIT/3/kick_high_left02_poses.npy,0,117,000003.npy
"""
TEXTS = {
    "000001": "a person walks#a/DET person/NOUN walk/VERB#0.0#0.0\nhe stops.#he/PRON stop/VERB#0.5#1.5\n",
    "000002": "someone golfs#someone/PRON golf/VERB#0.0#0.0\n",
    "000003": "kicks#kick/VERB#0.0#0.0\n",
}
PHRASES = "Subject #1 (walking)\n\n01_01\twalk, stop\n60_01\tsalsa\n63_01\tswing\n64_01\tUnknown\n104_01\tbroken\n"
RATES = {"01_01": 120, "60_01": 60, "63_01": 120}


class Answers(BaseHTTPRequestHandler):
    """Files of a dictionary; the first answer for each breaks off half way."""

    def __init__(self, files: dict[str, bytes], asked: list[tuple[str, str]], *arguments):
        self.files, self.asked = files, asked
        super().__init__(*arguments)

    def do_GET(self):
        """What the server answers."""
        body, given = self.files.get(self.path), self.headers.get("Range", "")
        first = self.path not in {path for path, _ in self.asked}
        self.asked.append((self.path, given))
        if body is None:
            self.send_error(404)
            return
        start = int(given.removeprefix("bytes=").rstrip("-") or 0)
        self.send_response(206 if given else 200)
        self.send_header("Content-Length", str(len(body) - start))
        self.end_headers()
        self.wfile.write(body[start : start + len(body) // 2] if first else body[start:])

    def log_message(self, *_):
        """Silence."""


@pytest.fixture
def server():
    """(places, files, what was asked): everything of three takes, their indices and texts."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        for name, text in TEXTS.items():
            file.writestr(f"texts/{name}.txt", text)
    files = {
        "/h/index.csv": INDEX.encode(),
        "/h/HumanML3D/texts.zip": packed.getvalue(),
        "/i/cmu-mocap-index-text.txt": PHRASES.encode(),
    }
    for take, rate in RATES.items():
        subject = take.split("_")[0]
        files |= {f"/c/{subject}/{subject}.asf": asf().encode(), f"/c/{subject}/{take}.amc": amc(4 * rate + 1).encode()}
    asked: list[tuple[str, str]] = []
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Answers, files, asked)) as web:
        threading.Thread(target=web.serve_forever, daemon=True).start()
        base = f"http://127.0.0.1:{web.server_port}"
        yield {"cmu": f"{base}/c", "humanml3d": f"{base}/h", "index": f"{base}/i"}, files, asked
        web.shutdown()


def lines_of(folder: Path) -> dict[str, dict]:
    """The lines of clips.jsonl by motion."""
    return {row["motion"]: row for row in map(json.loads, (folder / "clips.jsonl").read_text().splitlines())}


def test_takes_come_whole_over_connections_that_break_and_become_a_corpus(server, tmp_path):
    places, _, asked = server
    found = fetch_cmu(tmp_path / "cmu", places=places, progress=False, wait=0.01)
    assert found == {"takes": 3, "sentences": 6, "problems": []}
    assert {path for path, given in asked if given} == {
        path for path, _ in asked
    }  # each broke off, and was gone on with
    assert not any("104" in path or "/64/" in path for path, _ in asked)  # one is broken, one is another's twin
    rows = lines_of(tmp_path / "cmu")
    assert rows["motions/01_01.npy"] == {
        "motion": "motions/01_01.npy", "fps": 20.0, "subject": "cmu-01",
        "captions": [
            {"text": "a person walks", "start": 1.0, "end": 3.0, "source": "humanml3d"},
            {"text": "he stops.", "start": 1.5, "end": 2.5, "source": "humanml3d"},
            {"text": "walk, stop", "start": 0.0, "end": 4.05, "source": "cmu-index"},
        ],
    }  # fmt: skip
    assert [c["text"] for c in rows["motions/63_01.npy"]["captions"]] == ["someone golfs", "swing"]
    for take, rate in RATES.items():
        assert rate_of(take) == rate
        positions = np.load(tmp_path / "cmu" / f"motions/{take}.npy")
        assert positions.shape == (81, 22, 3)
        way = positions[-1, 0] - positions[0, 0]  # the root, in metres: 0.01 units of 0.0254 / 0.45 m a frame
        np.testing.assert_allclose(way, [0, 0, 4 * rate * 0.01 * 0.0254 / 0.45], atol=1e-3 + 0.1 * way[2])
    data = {"source": "folder", "roots": [str(tmp_path / "cmu")], "workers": 1, "ratios": [0.6, 0.2, 0.2]}
    report = preprocess({**data, "mirror": False}, tmp_path / "corpus", progress=False)
    assert report["kept"] == 3
    assert report["problem_count"] == 0


def test_a_second_run_asks_for_nothing_that_is_there(server, tmp_path):
    places, files, asked = server
    kept = files.pop("/c/60/60_01.amc")
    first = fetch_cmu(tmp_path, places=places, progress=False, wait=0.01)
    assert (first["takes"], [str(p).split(":")[0] for p in first["problems"]]) == (2, ["http"])
    assert "404" in str(first["problems"][0])
    files["/c/60/60_01.amc"] = kept
    asked.clear()
    assert fetch_cmu(tmp_path, places=places, progress=False, wait=0.01)["takes"] == 3
    assert {path for path, _ in asked} == {"/c/60/60_01.amc"}


def test_what_is_not_the_manifests_is_refused_and_leaves_nothing(server, tmp_path, capsys):
    places, files, _ = server
    fetch_cmu(tmp_path / "first", places=places, progress=False, wait=0.01)
    manifest = tmp_path / "first/downloads/downloads.jsonl"
    rows = [json.loads(line) for line in manifest.read_text().splitlines()]
    assert all(row["licence"] and row["url"] and row["bytes"] and len(row["sha256"]) == 64 for row in rows)
    mirrors = [f"--mirror={name}={url}" for name, url in places.items()]
    command = ["fetch", "cmu", "--manifest", str(manifest), "--takes", "01_01,63_01", *mirrors]
    assert main([*command, "--out", str(tmp_path / "same")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'same'}: 2 takes, 5 sentences\n"
    files["/c/63/63_01.amc"] += b"\n"
    files["/h/index.csv"] += b"\n"
    assert main([*command, "--out", str(tmp_path / "other")]) == 2
    assert "error: index.csv: SHA-256" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "other").rglob("*") if path.is_file()] == []
    files["/h/index.csv"] = INDEX.encode()
    assert main([*command, "--out", str(tmp_path / "other")]) == 2
    assert "63_01.amc: SHA-256" in capsys.readouterr().err
    assert set(lines_of(tmp_path / "other")) == {"motions/01_01.npy"}
    assert not (tmp_path / "other/downloads/63_01.amc").exists()


def test_pages_in_place_of_files_and_bad_arguments_are_named(server, tmp_path):
    places, files, _ = server
    with pytest.raises(InputError, match="takes: 99_99: is in neither index"):
        fetch_cmu(tmp_path, ["99_99"], places=places, progress=False, wait=0.01)
    with pytest.raises(InputError, match="places: moon=http"):
        fetch_cmu(tmp_path, places={"moon": "http://x"}, progress=False)
    files["/c/01/01.asf"] = b"<html>We are moving.</html>"
    with pytest.raises(InputError, match=r"no take.*01\.asf"):
        fetch_cmu(tmp_path, ["01_01"], places=places, progress=False, wait=0.01)
    assert not (tmp_path / "clips.jsonl").exists()
    files["/c/01/01.asf"] = asf().encode()
    assert fetch_cmu(tmp_path, ["01_01"], places=places, progress=False, wait=0.01)["takes"] == 1
    files["/h/HumanML3D/texts.zip"] = b"<html></html>"
    with pytest.raises(InputError, match=r"texts\.zip must be HumanML3D's"):
        fetch_cmu(tmp_path / "new", places=places, progress=False, wait=0.01)
    with pytest.raises(InputError, match="in 2 attempts; run the same again"):
        fetch_cmu(tmp_path / "none", places={"humanml3d": "http://127.0.0.1:9"}, progress=False, attempts=2, wait=0.01)
