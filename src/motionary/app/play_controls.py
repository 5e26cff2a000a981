"""The page's controls for what plays: time, speed, look, view."""

from __future__ import annotations

from typing import Any

from motionary.app import limits
from motionary.app.figures import LOOKS
from motionary.app.limits import among
from motionary.app.player import Player
from motionary.app.turns import Turns

_HINT = "Seconds. Playing stops where this is put."


class PlayControls:
    """A scrubber and what else a player obeys.

    The running clock moves a bar above the scrubber, not the scrubber itself: a page loses what is clicked or typed
    where a number changes at the same moment.
    """

    def __init__(self, client: Any, turns: Turns):
        gui = client.gui
        with gui.add_folder("Play"):
            self._bar = gui.add_progress_bar(0.0)
            self._clock = gui.add_slider("Time", min=0.0, max=10.0, step=0.01, initial_value=0.0, hint=_HINT)
            self._playing = gui.add_checkbox("Playing", True)
            speed = gui.add_slider("Speed", min=limits.SPEEDS[0], max=limits.SPEEDS[1], step=0.1, initial_value=1.0)
            look = gui.add_dropdown("Look", LOOKS)
            follow = gui.add_checkbox("Camera follows", True)
            camera = gui.add_button("Reset the camera")
        self.player = player = Player(client, self._told)
        self._clock.on_update(self._seek)
        self._playing.on_update(lambda _: self._play(bool(self._playing.value)))
        speed.on_update(lambda _: player.set_speed(float(speed.value)))
        look.on_update(lambda _: turns.start("Dressing", lambda: player.set_look(among("look", look.value, LOOKS))))
        follow.on_update(lambda _: player.set_follow(bool(follow.value)))
        camera.on_click(lambda _: player.look_at_all())

    def reset(self) -> None:
        """Lets the scrubber reach as far as what is shown now, from its beginning."""
        self._clock.max = max(round(self.player.duration, 2), 0.01)
        self._show(self.player.seconds)

    def _play(self, playing: bool) -> None:
        """Starts, or stops and tells where."""
        self.player.playing = playing
        if not playing:
            self._show(self.player.seconds)

    async def _seek(self, event: Any) -> None:  # in viser's loop, so that places come in the order they were sent
        """Stops where the visitor puts the scrubber."""
        if event.client is None:
            return  # moved by `_show`
        self.player.playing = False
        self.player.seek(float(self._clock.value))
        self._playing.value = False
        self._told(self.player.seconds)

    def _show(self, seconds: float) -> None:
        """Puts scrubber and bar."""
        self._clock.value = min(round(seconds, 2), float(self._clock.max))
        self._told(seconds)

    def _told(self, seconds: float) -> None:
        self._bar.value = 100 * seconds / max(self.player.duration, 0.01)
