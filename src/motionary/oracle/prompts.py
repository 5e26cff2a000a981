"""Prompts whose outcome the oracle can judge, and the judgment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from motionary.oracle.claims import Claims, expected
from motionary.oracle.reading import Attributes, read
from motionary.oracle.thresholds import DEFAULT, Thresholds

if TYPE_CHECKING:
    from motionary.motion import Motion


@dataclass(frozen=True)
class Prompt:
    """A text about side, direction or speed, what it claims, and the action label of real clips that show it."""

    text: str
    action: str
    claims: Claims


def _prompts() -> tuple[Prompt, ...]:
    prompts = []
    for side in ("left", "right", "both"):
        hand, arm = ("both hands", "both arms") if side == "both" else (f"the {side} hand", f"the {side} arm")
        action = f"{side}-hand" if side != "both" else "both-hands"
        raised: Claims = {"raised": side, "waving": "none"}
        prompts += [Prompt(f"a person raises {hand}", f"raise-up-{action}", raised)]
        prompts += [Prompt(f"a person lifts {arm} up and lowers it", f"raise-up-{action}", raised)]
        waved: Claims = {"raised": side, "waving": side}
        prompts += [Prompt(f"a person waves with {hand}", f"wave-{action}", waved)]
        prompts += [Prompt(f"a person is waving {arm}", f"wave-{action}", waved)]
    for side in ("left", "right"):
        turned: Claims = {"gait": "walk", "direction": "forward", "turned": side}
        prompts += [Prompt(f"a person walks forward and turns {side}", f"walk-turn-{side}", turned)]
        prompts += [Prompt(f"a person walks straight ahead and takes a {side} turn", f"walk-turn-{side}", turned)]
        sideways: Claims = {"gait": "walk", "direction": side}
        prompts += [Prompt(f"a person walks sideways to the {side}", f"walk-{side}", sideways)]
        prompts += [Prompt(f"a person side steps to the {side}", f"walk-{side}", {"direction": side})]
    forward: Claims = {"gait": "walk", "direction": "forward"}
    backward: Claims = {"gait": "walk", "direction": "backward"}
    running: Claims = {"gait": "run", "direction": "forward"}
    prompts += [Prompt("a person walks forward", "walk", forward)]
    prompts += [Prompt("a person runs forward", "run", running)]
    prompts += [Prompt("a person dashes forward", "dash", running)]
    prompts += [Prompt("a person walks backwards", "walk-back", backward)]
    prompts += [Prompt("a person steps backward", "walk-back", {"direction": "backward"})]
    return tuple(prompts)


PROMPTS = _prompts()


def confirm(motion: Motion, prompt: str | Claims | Prompt, thresholds: Thresholds = DEFAULT) -> bool | None:
    """Whether a motion shows all that a prompt claims.

    Args:
        motion: the motion, of any skeleton with limbs.
        prompt: a caption, its claims (`expected`), or one of `PROMPTS`.
        thresholds: where to draw the lines.

    Returns:
        True or False, or None where the prompt claims nothing that the oracle can read.
    """
    claims = prompt.claims if isinstance(prompt, Prompt) else expected(prompt) if isinstance(prompt, str) else prompt
    return holds(read(motion, thresholds), claims) if claims else None


def holds(attributes: Attributes, claims: Claims) -> bool:
    """Whether attributes satisfy every claim."""
    return not failures(attributes, claims)


def failures(attributes: Attributes, claims: Claims) -> list[str]:
    """The claims that attributes do not satisfy, by name."""
    wrong = []
    for name, value in claims.items():
        found = getattr(attributes, name)
        good = value[0] <= found <= value[1] if isinstance(value, tuple) else found == value
        if not good:
            wrong.append(name)
    return wrong
