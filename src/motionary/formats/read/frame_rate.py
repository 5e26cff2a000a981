"""The rate that a file's frame time means: programs round it to few digits."""

from __future__ import annotations

from decimal import Decimal

# Rates that motion is recorded, drawn and shown at; those of television are no whole numbers.
USUAL = (10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 72, 75, 90, 100, 120, 144, 150, 200, 240, 250, 300, 480, 500, 1000)
_BROADCAST = (24000 / 1001, 30000 / 1001, 60000 / 1001, 120000 / 1001)
_EXACT = 5e-4  # of a rate: what is so near to a whole number is it
_NEAR = 0.02  # of a rate: what is rounded by more is told


def rounding(number: str) -> float:
    """Half a unit of the last digit of a number as a file writes it: .0005 for 0.033."""
    exponent = Decimal(number).as_tuple().exponent
    return 0.5 * 10.0**exponent if isinstance(exponent, int) else 0.0


def rate_of(frame_time: float, rounded: float) -> tuple[float, str]:
    """Frames per second, and a note where they are in doubt, else "".

    Args:
        frame_time: seconds per frame, above 0, as the file says.
        rounded: by how much it may be off, of `rounding`.

    A whole number that was not rounded counts first (0.04 is 25), then a usual rate that would be written so (0.0333
    is 30), then a whole number that is near, else the file's own.
    """
    fps = 1 / frame_time
    least, most = 1 / (frame_time + rounded), 1 / max(frame_time - rounded, 1e-9)
    usual = [rate for rate in USUAL if least < rate < most] or [rate for rate in _BROADCAST if least < rate < most]
    nearest, whole = min(usual, key=lambda rate: abs(rate - fps), default=None), float(max(round(fps), 1))
    if abs(fps / whole - 1) < (_EXACT if nearest is None else 1e-9):
        return whole, "" if nearest is None or whole in USUAL else _doubt(frame_time, whole, nearest)
    if nearest is None:
        return fps, ""
    return float(nearest), _doubt(frame_time, nearest, fps) if abs(fps / nearest - 1) > _NEAR else ""


def _doubt(frame_time: float, taken: float, other: float) -> str:
    said = f"Frame Time {frame_time:g} is rounded: took {taken:g} frames a second, it may mean {other:.4g}"
    return f"{said} (say otherwise with --source-fps or --fps; in Python fps=)"
