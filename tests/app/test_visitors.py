"""Visitors who send what the page's own controls would not: the server holds the limits, and says so in one line."""

from __future__ import annotations

import time
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from viser import _messages as messages
from visitor import Visitor

from motionary import Motion
from motionary.app import limits, server
from motionary.corpus.demo import demo_clip

MOTION = "Upload a motion (BVH, NPZ)"
MEGABYTE = 2**20


@pytest.fixture(scope="module")
def app(pipeline):
    app = server.App(pipeline / "models", "cpu", "127.0.0.1", 0)
    yield app
    app.close()


@pytest.fixture
def visit(app):
    visitors: list[Visitor] = []

    def new() -> Visitor:
        visitors.append(Visitor(app.url))
        visitors[-1].until(lambda: MOTION in visitors[-1].controls and "Time" in visitors[-1].controls, "the page")
        return visitors[-1]

    yield new
    for visitor in visitors:
        visitor.close()


def pending(app: server.App) -> dict:
    """The unfinished uploads of the newest visitor, as the server keeps them."""
    return app.server.get_clients()[max(app.server.get_clients())].gui._current_file_upload_states


def soon(holds, seconds: float = 30.0) -> bool:
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.02)
    return holds()


def saved(motion: Motion, path: Path) -> bytes:
    motion.save(path)
    return path.read_bytes()


def lasting(seconds: float) -> Motion:
    """A walk to and fro."""
    walk = demo_clip(3)[0]
    there = np.concatenate([walk.positions, walk.positions[::-1]])
    frames = np.arange(round(seconds * walk.fps)) % len(there)
    return Motion(there[frames], walk.fps, walk.skeleton)


@pytest.mark.parametrize(
    ("button", "control", "value", "rule"),
    [
        ("Generate", "Variants", 1_000_000, "variants: 1000000: must be a number from 1 to 6"),
        ("Generate", "Variants", -1, "variants: -1: must be a number from 1 to 6"),
        ("Generate", "Seconds", 1e9, "seconds: 1000000000.0: must be a number from 0 to 9.8"),
        ("Generate", "Seconds", float("nan"), "seconds: nan: must be a number from 0 to 9.8"),
        ("Generate", "Seed", 2**40, "seed: 1099511627776: must be a number from 0 to"),
        ("Generate", "System", "../models/text2motion", "system: ../models/text2motion: must be one of"),
        ("Generate", "System", "evaluator", "system: evaluator: must be one of"),
        ("Generate", "Prompt", "walk " * 1000, "at most 1000 characters"),
        ("Search", "Matches", 10**9, "matches: 1000000000: must be a number from 1 to 6"),
        ("Search", "Look for", "jump " * 1000, "at most 1000 characters"),
    ],
)
def test_what_no_control_offers_is_refused(visit, button, control, value, rule):
    visitor = visit()
    visitor.ask(control, value)
    visitor.ask(button)
    visitor.until(lambda: visitor.notes, "a refusal")
    assert visitor.notes[0].startswith("That does not work: ")
    assert rule in visitor.notes[0]


def test_a_result_is_only_written_as_files_that_the_page_offers(visit, tmp_path):
    visitor, target = visit(), tmp_path / "x.bvh"
    visitor.ask("Generate")
    visitor.until(lambda: "Download" in visitor.controls, "a result")
    visitor.until(lambda: any(text.startswith("Read as") for text in visitor.texts), "the end of it")
    for value in (f"/../../../..{target}", f"bvh/../../../..{target}", "exe", ""):
        visitor.notes.clear()
        visitor.ask("Download", value)
        visitor.until(lambda: visitor.notes, "a refusal")
        assert "must be one of .bvh, .glb, .npz" in visitor.notes[0]
    assert not target.exists()
    visitor.ask("Download", "bvh")
    visitor.until(lambda: visitor.files, "a file that it does offer")


def test_a_clock_sent_nonsense_runs_on(app, visit):
    visitor = visit()
    visitor.ask("Generate")
    visitor.until(lambda: any(text.startswith("Read as") for text in visitor.texts), "a result")
    player = app._panels[max(app._panels)].player
    last = player.duration
    for value, seconds in ((float("nan"), 0.0), (1e300, last), (float("inf"), 0.0), (-5.0, 0.0)):
        player.seconds = 0.1
        visitor.ask("Time", value)
        assert soon(lambda: not player.playing and player.seconds == seconds), value  # noqa: B023
    for value, speed in ((1e300, limits.SPEEDS[1]), (-1.0, limits.SPEEDS[0]), (float("nan"), 1.0)):
        visitor.ask("Speed", value)
        assert soon(lambda: player.speed == speed), value  # noqa: B023
    visitor.ask("Playing", True)
    assert soon(lambda: 0 < player.seconds < player.duration)


def test_an_upload_that_may_not_be_is_refused_when_it_is_announced(app, visit):
    visitor = visit()
    cases = [
        (limits.MOST_BYTES + 1, 1, "at most 20 MB can be read"),
        (-1, 1, "does not say how large"),
        (10, -1, "does not say how large"),
        (10, limits.MOST_PARTS + 1, "does not say how large"),
    ]
    for size, parts, message in cases:
        visitor.notes.clear()
        visitor.begin_upload(MOTION, "a.bvh", size, parts)
        visitor.until(lambda: visitor.notes, message)
        assert message in visitor.notes[0]
        assert not pending(app)


def test_unfinished_uploads_are_few_and_small_and_go_with_their_visitor(app, visit):
    visitor = visit()
    client = app.server.get_clients()[max(app.server.get_clients())]
    for k in range(limits.MOST_UNFINISHED):
        transfer = visitor.begin_upload(MOTION, f"{k}.bvh", 8 * MEGABYTE, 8)
        visitor.send_part(MOTION, transfer, 0, bytes(MEGABYTE))
    visitor.begin_upload(MOTION, "more.bvh", 10)
    visitor.until(lambda: visitor.notes, "a refusal of one too many")
    assert "at most 2 files at a time" in visitor.notes[0]
    kept = pending(app)
    assert len(kept) == limits.MOST_UNFINISHED
    assert soon(lambda: sum(state["transferred_bytes"] for state in kept.values()) == 2 * MEGABYTE)
    visitor.close()
    assert soon(lambda: client.client_id not in app.server.get_clients())
    assert soon(lambda: not kept), "dropped when the visitor leaves"

    other = visit()
    other.begin_upload(MOTION, "large.bvh", 15 * MEGABYTE, 15)
    other.begin_upload(MOTION, "second.bvh", 6 * MEGABYTE, 6)
    other.until(lambda: other.notes, "a refusal of too many bytes")
    assert "at most 20 MB at a time" in other.notes[0]
    assert len(pending(app)) == 1


def test_an_upload_that_is_not_what_it_said_is_dropped(app, visit):
    visitor = visit()
    transfer = visitor.begin_upload(MOTION, "a.bvh", 10, 3)
    visitor.send_part(MOTION, transfer, 0, bytes(11))
    visitor.until(lambda: visitor.notes, "a refusal")
    assert "larger than it said" in visitor.notes[0]
    assert not pending(app)
    transfer = visitor.begin_upload(MOTION, "a.bvh", 10, 3)
    assert soon(lambda: pending(app))
    visitor.send_part(MOTION, transfer, 0, [[0] * 100] * 5)  # no bytes: five in number, more in memory
    assert soon(lambda: not pending(app))


def test_a_file_is_for_upload_buttons_alone(app, visit):
    visitor = visit()
    visitor.upload("Variants", "a.bvh", b"x")
    transfer = visitor.begin_upload(MOTION, "a.bvh", 2, 2)
    visitor.send_part(MOTION, transfer, 0, b"x")
    visitor.send_part("Variants", transfer, 1, b"x")
    visitor.ask("Generate")
    visitor.until(lambda: any(text.startswith("Read as") for text in visitor.texts), "a result with one variant")
    assert not pending(app)


def test_a_read_file_is_not_kept(app, visit, tmp_path):
    visitor = visit()
    visitor.upload(MOTION, "walk.bvh", saved(demo_clip(3)[0], tmp_path / "x.bvh"))
    visitor.until(lambda: any("walk.bvh" in text for text in visitor.texts), "the motion")
    handles = app.server.get_clients()[max(app.server.get_clients())].gui._gui_input_handle_from_uuid
    assert handles[visitor.controls[MOTION]].value.content == b""


def test_a_large_message_ends_its_sender_s_connection_alone(visit):
    from websockets.exceptions import ConnectionClosed

    visitor, other = visit(), visit()
    visitor.send(messages.GuiUpdateMessage(visitor.controls["Prompt"], {"value": "x" * (3 * MEGABYTE)}))
    with pytest.raises(ConnectionClosed):
        visitor.until(lambda: False, "anything")
    other.ask("Generate")
    other.until(lambda: any(text.startswith("Read as") for text in other.texts), "a result")


def test_visitors_who_leave_at_once_leave_nothing(app):
    for _ in range(20):
        Visitor(app.url).close()
    assert soon(lambda: not app.server.get_clients())
    assert soon(lambda: not app._panels)


def test_another_visitor_s_video_of_a_minute_is_announced_and_delays_nobody(visit, tmp_path):
    heavy, light = visit(), visit()
    walk = saved(demo_clip(3)[0].crop(0, 40), tmp_path / "walk.bvh")

    def read(name: str) -> float:
        begin = time.monotonic()
        light.upload(MOTION, name, walk)
        light.until(lambda: any(name.partition(".")[0] in text for text in light.texts), name)
        light.until(lambda: any(text.startswith("**Captions**") for text in light.texts), name)
        light.texts.clear()
        return time.monotonic() - begin

    alone = median(read(f"alone{k}.bvh") for k in range(3))
    heavy.upload(MOTION, "long.bvh", saved(lasting(90), tmp_path / "long.bvh"))
    heavy.until(lambda: any("films: the first 60 s" in text for text in heavy.texts), "what a video will show")
    heavy.until(lambda: any("Captions" in text for text in heavy.texts), "the end of reading")
    heavy.ask("Download", "mp4")
    heavy.until(lambda: any("Making a video of 60.0 s" in text for text in heavy.texts), "the video's beginning")
    beside = median(read(f"beside{k}.bvh") for k in range(5))
    assert beside - alone < 3.0, (beside, alone)
    assert not heavy.files
