"""The page in a real browser: a prompt typed, a motion seen moving, files downloaded and read, visitors kept apart.

Needs Chromium or Chrome, which `make test` installs; without one these tests fail and say so. With APP_MODELS a folder
of trained models is shown in place of the untrained ones, and with APP_PICTURE the page's picture is kept there:

    APP_MODELS=models APP_PICTURE=docs/app.png python -m pytest tests/app/test_browser.py -k at_once
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from browser import launched
from PIL import Image
from playwright.sync_api import Browser, Locator, Page
from tiny import add_stylizers

from motionary import read_motion
from motionary.corpus.demo import demo_clip

PATIENCE = 240_000  # milliseconds: the machine may be busy with other things
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SLIDER = "xpath=//label[normalize-space()='{}']/following::*[@role='slider'][1]"  # the thumb beside a label
BLOCK = 5  # pixels along a side; FIGURE is whole blocks
FIGURE = {"x": 180, "y": 155, "width": 360, "height": 500}  # of the page: where motions stand, no controls


@pytest.fixture(scope="module")
def url(pipeline, tmp_path_factory):
    models = os.environ.get("APP_MODELS")
    if models is None:
        models = shutil.copytree(pipeline, tmp_path_factory.mktemp("app") / "project") / "models"
        add_stylizers(pipeline, models)
    command = [sys.executable, "-m", "motionary.cli", "app", "--port", "0", "--models", str(models), "--device", "cpu"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    line = next((line for line in server.stdout if "motionary is at" in line), "")
    yield line.split()[3]
    server.terminate()
    assert server.wait(240) == 0


@pytest.fixture(scope="module")
def browser():
    with launched(FLAGS) as started:
        yield started


@pytest.fixture
def visit(browser: Browser, url: str):
    """Opens the page as a new visitor; the test fails where the page does."""
    contexts, errors = [], []

    def new(width: int = 1100, height: int = 720) -> Page:
        contexts.append(browser.new_context(viewport={"width": width, "height": height}, accept_downloads=True))
        page = contexts[-1].new_page()
        page.on("pageerror", lambda error: errors.append(error))
        page.set_default_timeout(PATIENCE)
        page.goto(url)
        page.get_by_text("Captioned:").wait_for()  # the first motion plays, and has been read
        return page

    yield new
    for context in contexts:
        context.close()
    assert not errors


def still(page: Page) -> np.ndarray:
    """The page with its motion stopped at the beginning."""
    playing = page.get_by_role("checkbox").first
    for _ in range(20):  # the page may draw what it had before a click has reached it
        if playing.is_checked():
            playing.click(force=True)
            page.wait_for_timeout(500)
    assert not playing.is_checked()
    put(page, "Time", 0.0)
    return settled(page)


def picture(page: Page, clip: Any = FIGURE) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")).astype(int)


def changed(a: np.ndarray, b: np.ndarray) -> int:
    """Pixels that differ clearly."""
    return int((np.abs(a - b).max(-1) > 25).sum())


def alike(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether nothing has moved. By the means of blocks: the page draws coarser while the machine is busy."""
    blocks = (a - b).reshape(len(a) // BLOCK, BLOCK, -1, BLOCK, 3).mean((1, 3))
    return bool(np.abs(blocks).max() < 20)


def until(page: Page, holds: Callable[[], bool], what: str) -> None:
    """Waits as long as a busy machine may need."""
    for _ in range(200):
        if holds():
            return
        page.wait_for_timeout(300)
    pytest.fail(f"never came: {what}")


def settled(page: Page) -> np.ndarray:
    """The picture once it has not changed for two seconds: what was asked has arrived and been drawn."""
    seen = picture(page)
    for _ in range(100):
        page.wait_for_timeout(2000)
        last, seen = seen, picture(page)
        if changed(last, seen) == 0:
            return seen
    pytest.fail("the picture never comes to rest")


def generate(page: Page, text: str) -> None:
    control(page, "Prompt").fill(text)
    control(page, "Prompt").press("Enter")
    page.get_by_text("Read as:").wait_for()


def download(page: Page, extension: str, folder: Path) -> Path:
    with page.expect_download() as caught:
        page.get_by_role("button", name=extension, exact=True).last.click()
    target = folder / caught.value.suggested_filename
    caught.value.save_as(target)
    return target


def upload(page: Page, path: Path, button: str = "Upload a motion") -> None:
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name=button).click()
    chooser.value.set_files(path)


def control(page: Page, label: str) -> Locator:
    """The box of text or of a number beside a label."""
    return page.locator(f"xpath=//label[normalize-space()='{label}']/following::input[@type='text' or not(@type)][1]")


def put(page: Page, label: str, value: object) -> None:
    control(page, label).fill(str(value))
    control(page, label).blur()


def point(page: Page, label: str, share: float) -> None:
    """Clicks on a slider's track, at a share of its way."""
    around = "ancestor::*[contains(@class, 'Slider-trackContainer')]"
    track = page.locator(f"{SLIDER.format(label)}/{around}").bounding_box()
    assert track is not None
    page.mouse.click(track["x"] + share * track["width"], track["y"] + track["height"] / 2)


def choose(page: Page, label: str, value: str) -> None:
    control(page, label).click()
    page.get_by_role("option", name=value, exact=True).click()


def test_a_motion_plays_at_once_and_a_prompt_s_files_are_read(visit, tmp_path):
    page = visit()
    first = picture(page)
    until(page, lambda: changed(first, picture(page)) > 30, "a movement")
    generate(page, "a person waves with the left hand")
    page.get_by_role("button", name="npz", exact=True).wait_for()
    page.get_by_text("Captioned:").wait_for()
    if "APP_PICTURE" in os.environ:
        for note in page.locator("button.mantine-Notification-closeButton").all():
            note.click()  # that there is no GPU is of no interest to others
            page.wait_for_timeout(1000)
        page.screenshot(path=os.environ["APP_PICTURE"])
    still(page)
    motion = read_motion(download(page, "bvh", tmp_path))
    assert motion.frames > 3
    assert len(motion.skeleton.joints) >= 22
    assert np.ptp(motion.positions, axis=0).max() > 0
    document = pygltflib.GLTF2().load(str(download(page, "glb", tmp_path)))
    assert document.animations
    assert download(page, "mp4", tmp_path).read_bytes()[4:8] == b"ftyp"
    assert "<canvas>" in download(page, "html", tmp_path).read_text()


def test_a_phone_has_the_motion_above_the_controls(visit):
    page = visit(390, 844)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    above = {"x": 0, "y": 0, "width": 390, "height": 335}
    first = picture(page, above)
    until(page, lambda: changed(first, picture(page, above)) > 30, "a movement")
    top = page.get_by_text("Say what a person does").bounding_box()["y"]
    assert top > 330
    generate(page, "a person walks")
    assert page.get_by_role("button", name="glb", exact=True).count() == 1


def test_visitors_do_not_see_each_other_and_uploads_are_checked(visit, tmp_path):
    ann, ben = visit(), visit()
    before = still(ben)
    generate(ann, "a person turns around")
    assert ann.get_by_text("a person turns around").count() > 0
    ben.wait_for_timeout(1500)
    assert ben.get_by_text("a person turns around").count() == 0
    assert ben.get_by_text("Read as:").count() == 0
    assert alike(before, picture(ben))

    ben.get_by_role("tab", name="Read").click()
    broken, large, walk = tmp_path / "broken.bvh", tmp_path / "large.npz", tmp_path / "walk.bvh"
    broken.write_text("HIERARCHY\nROOT hips\n{ nonsense")
    upload(ben, broken)
    ben.get_by_text("That does not work").wait_for()
    assert ben.get_by_text("broken.bvh").count() > 0  # one line that names the file and the rule
    large.write_bytes(bytes(21 * 2**20))
    upload(ben, large)
    ben.get_by_text("The file was not taken").wait_for()
    demo_clip(3)[0].save(walk)
    upload(ben, walk)
    ben.get_by_text("Captions", exact=True).wait_for()
    assert ben.get_by_text("walk.bvh").count() > 0
    assert ann.get_by_text("walk.bvh").count() == 0

    ben.get_by_role("tab", name="Search").click()
    ben.get_by_role("button", name="Search", exact=True).click()
    ben.get_by_text("3 matches").wait_for()
    assert ben.get_by_role("button", name="glb", exact=True).count() == 3
    assert ann.get_by_role("button", name="glb", exact=True).count() == 1


def test_playback_obeys(visit):
    page = visit()
    generate(page, "a person waves with the left hand")
    playing, bar = page.get_by_role("checkbox").first, page.get_by_role("progressbar").first
    point(page, "Time", 0.5)  # the scrubber stops where it is put
    until(page, lambda: not playing.is_checked(), "a stop")
    settled(page)
    length = float(page.locator(SLIDER.format("Time")).get_attribute("aria-valuemax") or 0)
    assert abs(float(control(page, "Time").input_value()) - length / 2) < 0.1 * length
    playing.check(force=True)
    put(page, "Time", 0.4)  # and where a time is typed
    until(page, lambda: not playing.is_checked(), "a stop")
    early = settled(page)
    assert float(control(page, "Time").input_value()) == 0.4
    put(page, "Time", 0.0)
    until(page, lambda: changed(early, picture(page)) > 20, "another pose")
    settled(page)
    put(page, "Time", 0.4)
    until(page, lambda: alike(early, picture(page)), "the same pose again")

    choose(page, "Look", "skeleton")
    until(page, lambda: changed(early, picture(page)) > 300, "a skeleton")
    skeleton = settled(page)
    put(page, "Time", 0.0)
    until(page, lambda: changed(skeleton, picture(page)) > 20, "the skeleton in another pose")
    settled(page)
    put(page, "Time", 0.4)
    until(page, lambda: alike(skeleton, picture(page)), "the skeleton's same pose again")

    page.mouse.move(400, 300)
    page.mouse.down()
    page.mouse.move(500, 360, steps=5)
    page.mouse.up()
    until(page, lambda: changed(skeleton, picture(page)) > 300, "another side")
    settled(page)
    page.get_by_role("button", name="Reset the camera").click()
    until(page, lambda: alike(skeleton, picture(page)), "the side of the beginning")

    before = settled(page)
    put(page, "Speed", 0.1)
    put(page, "Time", 0.0)
    until(page, lambda: changed(before, picture(page)) > 20, "the first pose")  # so both have arrived
    playing.check(force=True)
    begin = time.monotonic()
    until(page, lambda: float(bar.get_attribute("aria-valuenow") or 0) > 0, "the clock running")
    page.wait_for_timeout(1500)
    playing.uncheck(force=True)  # the scrubber tells where it stopped
    until(page, lambda: float(control(page, "Time").input_value()) > 0, "the time of the stop")
    assert float(control(page, "Time").input_value()) <= 0.1 * (time.monotonic() - begin) + 0.05


def test_a_motion_is_stylized_by_label_by_chance_and_by_a_reference(visit, tmp_path):
    page = visit()
    page.get_by_role("tab", name="Read").click()
    content, reference = tmp_path / "content.npz", tmp_path / "reference.bvh"
    demo_clip(3)[0].save(content)
    demo_clip(5)[0].save(reference)
    upload(page, content)
    page.get_by_text("content.npz: ").wait_for()
    page.get_by_role("tab", name="Style").click()

    def stylized(style: str, strength: float) -> np.ndarray:
        """The result as it comes from a download, beside which the motion before stands."""
        choose(page, "Style", style)
        put(page, "Strength", strength)
        page.get_by_role("button", name="Stylize", exact=True).click()
        page.get_by_text(f"Stylized: {style}, strength {strength:g}, seed 0", exact=True).wait_for()
        until(page, lambda: page.get_by_role("button", name="bvh", exact=True).count() == 2, "two results")
        return read_motion(download(page, "bvh", tmp_path)).positions

    before = read_motion(content).positions
    control(page, "Style").click()
    offered = page.get_by_role("option").all_inner_texts()
    page.keyboard.press("Escape")
    label = offered[2]
    assert offered[:2] == ["by chance", "of the reference"]
    by_label = stylized(label, 1.0)
    assert by_label.shape[0] == pytest.approx(len(before), abs=4)
    assert np.isfinite(by_label).all()
    for other in (stylized(label, 0.5), stylized("by chance", 1.0)):  # untrained: small differences, but no rounding
        assert np.abs(other - by_label).max() > 5e-5

    choose(page, "Style", "of the reference")
    page.get_by_role("button", name="Stylize", exact=True).click()
    page.get_by_text("upload one first").wait_for()
    upload(page, reference, "Upload a reference")
    page.get_by_text("Reference: reference.bvh").wait_for()
    assert stylized("of the reference", 1.0).shape[0] == pytest.approx(len(before), abs=4)
