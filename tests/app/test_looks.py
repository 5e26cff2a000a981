"""The page outlives every look and every rig, in a real browser: what a player shows and takes away again."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
import viser
from browser import launched
from PIL import Image
from playwright.sync_api import Page

from motionary.app.figures import LOOKS
from motionary.app.player import Item, Player
from motionary.corpus.demo import demo_clip
from motionary.motion import Motion

PATIENCE = 240_000  # milliseconds
MIDDLE = {"x": 330, "y": 0, "width": 230, "height": 360}  # of the page: between notes and controls
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


@dataclass
class Watched:
    """A page, what plays in it, and what went wrong there."""

    page: Page
    player: Player
    errors: list[Any]
    step: Any
    steps: int = 0

    def arrived(self) -> None:
        """Waits until the page has done all that it was sent."""
        self.steps += 1
        self.step.content = f"step {self.steps}"
        self.page.get_by_text(self.step.content, exact=True).wait_for()
        assert not self.errors

    def drawn(self) -> int:
        """Pixels that are no floor."""
        seen = np.asarray(Image.open(io.BytesIO(self.page.screenshot(clip=MIDDLE))).convert("RGB")).astype(int)
        return int((np.ptp(seen, axis=-1) > 30).sum())

    def soon(self, holds: Callable[[], bool]) -> bool:
        """Waits for what the page is about to draw; whether it comes."""
        for _ in range(200):
            if holds():
                return True
            self.page.wait_for_timeout(100)
        return False


@pytest.fixture(scope="module")
def watched() -> Iterator[Watched]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    server.gui.add_markdown("welcome")
    with launched(FLAGS) as browser:
        page, errors = browser.new_page(viewport={"width": 900, "height": 360}), []
        page.on("pageerror", lambda error: errors.append(error))
        page.set_default_timeout(PATIENCE)
        page.goto(f"http://127.0.0.1:{server.get_port()}")
        page.get_by_text("welcome").wait_for()
        (client,) = server.get_clients().values()
        found = Watched(page, Player(client, lambda _: None), errors, client.gui.add_markdown(""))
        yield found
        found.player.close()
        server.stop()
    assert not errors


@pytest.fixture(scope="module")
def walk() -> Motion:
    return demo_clip(3)[0].crop(0, 10)


def test_the_page_outlives_every_look_in_every_order(watched, walk):
    order = [LOOKS[0], LOOKS[0], LOOKS[1], LOOKS[1]] * 2 + [LOOKS[0]]
    assert Counter(pairwise(order)) == Counter(2 * list(product(LOOKS, LOOKS)))  # each after each and itself, twice
    for k, look in enumerate(order):
        watched.player.set_look(look)
        watched.player.show([Item(walk, "")] * (1 + k % 2))
        watched.arrived()
    for look in LOOKS:
        watched.player.show([])
        watched.player.set_look(look)
        watched.arrived()
        assert watched.soon(lambda: watched.drawn() < 100)
        watched.player.show([Item(walk, "")])
        watched.arrived()
        assert watched.soon(lambda: watched.drawn() > 300), look


def test_the_page_outlives_mannequins_of_many_rigs(watched, walk):
    watched.player.set_look("mannequin")
    for size in np.linspace(0.5, 1.5, 10):
        motion = Motion(walk.positions * size, walk.fps, walk.skeleton)
        watched.player.show([Item(motion, ""), Item(walk, "")])
        watched.arrived()
    assert watched.soon(lambda: watched.drawn() > 300)
