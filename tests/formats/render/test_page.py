"""The HTML player: whole in one file, its data exact, and its script run for real (by node) on a recording canvas."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.formats.render.figure import limbs
from motionary.formats.render.page import player_assets, player_fragment, player_html
from motionary.formats.render.scene import Scene
from motionary.motion import Motion


def data_of(html: str) -> dict:
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html, re.S).group(1))


def test_positions_are_exact_to_a_millimetre(person):
    (packed,) = data_of(player_fragment([("", person)]))["motions"]
    raw = np.frombuffer(base64.b64decode(packed["data"]), "<i2").reshape(packed["frames"], packed["joints"], 3)
    positions = raw * packed["step"] + packed["origin"]
    drawn = sorted({0, *(p.begin for p in limbs(person.skeleton)), *(p.end for p in limbs(person.skeleton))})
    expected = person.positions[:, drawn] - Scene(person, 64, 64).down
    np.testing.assert_allclose(positions, expected, atol=5e-4)
    assert packed["fps"] == person.fps


def test_page_needs_no_network_and_nothing_escapes(person, tmp_path):
    person.save(tmp_path / "a.html", captions="</script><img src=x onerror=alert(1)> & more", title="<t>")
    html = (tmp_path / "a.html").read_text("utf-8")
    assert not re.search(r'(src|href)\s*=\s*["\']?(https?:)?//', html)
    assert "http" not in player_assets()
    assert "<img" not in html
    assert "&lt;/script&gt;&lt;img" in html
    assert "<title>&lt;t&gt;</title>" in html
    assert html.count("<script") == html.count("</script>") == 3  # the code, the data and its start
    assert len(html) < 60_000


def test_one_canvas_and_caption_per_motion(person):
    html = player_fragment([("first", person), ("second", person), ("", person)])
    assert html.count("<canvas>") == 3
    assert html.count("<figcaption>") == 2
    assert len(data_of(html)["motions"]) == 3
    assert player_html([("first", person)], page=True).startswith("<!doctype html>")
    assert player_html([("first", person)]).count('class="motionary"') == 1


def node() -> str | None:
    if found := shutil.which("node"):
        return found
    import playwright  # brings its own node

    found = Path(playwright.__file__).parent / "driver" / "node"
    return str(found) if found.exists() else None


HARNESS = """
const fs = require("fs"), vm = require("vm");
const html = fs.readFileSync(process.argv[2], "utf-8");
const scripts = [...html.matchAll(/<script([^>]*)>([\\s\\S]*?)<\\/script>/g)];
const json = scripts.find((s) => s[1].includes("json"))[2];
const arcs = [];
const context = new Proxy({}, { get: (t, k) => k in t ? t[k] : (...a) => {
  if (k === "arc") arcs.push(a);
  return { addColorStop() {} };
}, set: (t, k, v) => { t[k] = v; return true; } });
const canvas = { clientWidth: 300, clientHeight: 300, getContext: () => context };
const element = () => ({ setAttribute() {}, value: "1" });
const parts = { script: { textContent: json }, input: element(), button: element(), select: element(), output: {} };
const root = { querySelector: (s) => parts[s], querySelectorAll: () => [canvas],
  setAttribute() { this.started = true; } };
let step = null;
const window = { devicePixelRatio: 1, addEventListener() {} };
const document = { readyState: "complete", querySelectorAll: () => root.started ? [] : [root] };
const atob = (s) => Buffer.from(s, "base64").toString("binary");
const sandbox = { window, document, atob, requestAnimationFrame: (f) => { step = f; }, Math, JSON, Number, DataView,
  Float32Array, Uint8Array, Array, console };
sandbox.requestAnimationFrame.bind(null);
vm.runInNewContext(scripts.find((s) => !s[1])[2], sandbox);
const seen = [];
const frame = (ms) => { arcs.length = 0; step(ms); seen.push({ arcs: arcs.slice(), at: root.player.seconds }); };
frame(0); frame(50); frame(100);
parts.button.onclick(); frame(200);
parts.input.value = "1000"; parts.input.oninput(); frame(300);
canvas.setPointerCapture = () => {};
canvas.onpointerdown({ clientX: 0, clientY: 0, pointerId: 1 });
canvas.onpointermove({ clientX: 50, clientY: 20 }); frame(400);
parts.select.value = "2"; parts.input.value = "0"; parts.input.oninput(); parts.button.onclick(); frame(450);
console.log(JSON.stringify({ seen, view: root.player.view }));
"""


@pytest.fixture
def played(person, tmp_path):
    program = node()
    assert program, "node (or playwright, which brings it) is needed to run the player"
    person.save(tmp_path / "a.html")
    (tmp_path / "run.js").write_text(HARNESS)
    command = [program, str(tmp_path / "run.js"), str(tmp_path / "a.html")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_script_plays_pauses_scrubs_and_turns(played, person):
    at = [frame["at"] for frame in played["seen"]]
    last = (person.frames - 1) / person.fps
    np.testing.assert_allclose(at, [0, 0.05, 0.1, 0.1, last, last, 0.1], atol=1e-6)
    assert played["view"]["azimuth"] == pytest.approx(-0.5)
    assert played["view"]["elevation"] == pytest.approx(0.45)
    assert played["seen"][4]["arcs"] != played["seen"][5]["arcs"]


def test_script_projects_as_the_renderer_does(played, person):
    scene = Scene(person, 300, 300)
    for frame, index in ((0, 0), (4, person.frames - 1)):
        ends, scale = scene.camera.project(scene.ends[index], scene.target[index])
        arcs = np.array([[a[0], a[1], a[2]] for a in played["seen"][frame]["arcs"]])
        for place, radius in zip(ends, scene.radii[:, 1] * scale, strict=True):
            # every limb's end is drawn as an arc, unless its begin's circle hides it
            away = np.abs(arcs - [*place, radius]).max(-1)
            hidden = np.hypot(*(arcs[:, :2] - place).T) + radius <= arcs[:, 2] + 2
            assert away.min() < 2.5 or hidden.any()


def test_bad_input(person, tmp_path):
    with pytest.raises(InputError, match="at least one"):
        player_html([])
    with pytest.raises(InputError, match="captions"):
        person.save(tmp_path / "a.html", captions=["a", "b"])
    assert not list(tmp_path.iterdir())


def test_motions_side_by_side_share_their_scale(person):
    small = Motion(person.positions * 0.5, person.fps, person.skeleton)
    first, second = data_of(player_fragment([("large", person), ("small", small)]))["motions"]
    (alone,) = data_of(player_fragment([("small", small)]))["motions"]
    assert first["distance"] == second["distance"] > alone["distance"]
