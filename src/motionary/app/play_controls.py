"""The page's controls for what plays: time, speed, look, view."""

from __future__ import annotations

from typing import Any

from motionary.app import limits
from motionary.app.figures import LOOKS
from motionary.app.limits import among
from motionary.app.player import Player
from motionary.app.turns import Turns

_NUDGE = 1e-4  # seconds, fewer than the scrubber shows: viser sends no value that has not changed


class PlayControls:
    """A scrubber and what else a player obeys."""

    def __init__(self, client: Any, turns: Turns):
        gui = client.gui
        with gui.add_folder("Play"):
            self._clock = gui.add_slider("Time", min=0.0, max=10.0, step=0.01, initial_value=0.0)
            self._playing = gui.add_checkbox("Playing", True)
            speed = gui.add_slider("Speed", min=limits.SPEEDS[0], max=limits.SPEEDS[1], step=0.1, initial_value=1.0)
            look = gui.add_dropdown("Look", LOOKS)
            follow = gui.add_checkbox("Camera follows", True)
            camera = gui.add_button("Reset the camera")
        self.player = player = Player(client, self._told)
        self._clock.on_update(self._seek)
        self._playing.on_update(lambda _: setattr(player, "playing", bool(self._playing.value)))
        speed.on_update(lambda _: player.set_speed(float(speed.value)))
        look.on_update(lambda _: turns.start("Dressing", lambda: player.set_look(among("look", look.value, LOOKS))))
        follow.on_update(lambda _: player.set_follow(bool(follow.value)))
        camera.on_click(lambda _: player.look_at_all())

    def reset(self) -> None:
        """Lets the scrubber reach as far as what is shown now."""
        self._clock.max = max(round(self.player.duration, 2), 0.01)

    async def _seek(self, event: Any) -> None:  # in viser's loop, before the clock can overwrite what was sent
        """Stops where the visitor puts the scrubber."""
        if event.client is None:
            return  # moved by the clock
        seconds = float(self._clock.value)
        ran, self.player.playing = self.player.playing, False
        self.player.seek(seconds)
        if ran:
            self._playing.value = False
            # Shown anew: the clock's last report may reach the page after the visitor's own.
            self._clock.value = abs(seconds - _NUDGE)

    def _told(self, seconds: float) -> None:
        self._clock.value = min(round(seconds, 2), float(self._clock.max))
