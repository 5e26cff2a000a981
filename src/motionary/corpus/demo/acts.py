"""`Act`: the specification of one action, the truth that captions tell and motions show."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from motionary.corpus.demo.plan import LEFT, RIGHT


@dataclass(frozen=True)
class Act:
    """One action and its attributes; None where an attribute means nothing for the action.

    Attributes:
        action: the label, a key of `grammar.ACTIONS`.
        side: "left", "right" or "both": the limb that acts.
        direction: where the action goes: "forward", "backward", "left", "right", "up", "side".
        count: how often it is repeated.
        speed: "slow", "fast" or None for ordinary.
        angle: "quarter", "half" or "full" for turns.
    """

    action: str
    side: str | None = None
    direction: str | None = None
    count: int | None = None
    speed: str | None = None
    angle: str | None = None

    @property
    def sides(self) -> tuple[int, ...]:
        """Indices of the acting sides."""
        return {"left": (LEFT,), "right": (RIGHT,)}.get(self.side or "both", (LEFT, RIGHT))

    @property
    def turn(self) -> int:
        """+1 for left, -1 for right, 0 for straight: the sign of yaw and of x."""
        return {"left": 1, "right": -1}.get(self.direction or "", 0)

    @property
    def times(self) -> int:
        """The count, one where it means nothing."""
        return self.count or 1

    def attributes(self) -> dict[str, str | int]:
        """The attributes that mean something, as plain values."""
        return {key: value for key, value in asdict(self).items() if value is not None}
