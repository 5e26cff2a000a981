"""Where the oracle draws its lines."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Cuts of the oracle; lengths in arm or leg lengths (see `Signals`), times in seconds, angles in degrees.

    The first seven are fixed on labeled training clips by `fit_thresholds`; the stored values are what it found on the
    training clips of Bandai-Namco's styled motions (80% of the clips, by a hash of their names). The others follow
    from what the words mean and were checked on training clips of the demo corpus.
    """

    raise_standing: float = -0.37  # a raised wrist over its shoulder (95th percentile), of somebody who stands
    wave_swings: float = 5.5  # changes of direction of a raised hand
    run_speed: float = 11.4  # running: speed / run_speed + steps per second / run_steps + flight / run_flight > 1
    run_steps: float = 2.95
    run_flight: float = 0.434
    sideways: float = 14.8  # angle between where the body faces and where it goes
    turn: float = 67.7  # change of heading

    raise_moving: float = 0.15  # as raise_standing, while walking swings the arms
    still: float = 0.25  # leg lengths per second below which nobody goes anywhere
    swing: float = 0.025  # size of a wave's swing
    over_noise: float = 3.5  # a swing in standard deviations of the noise
    flight: float = 0.08  # lift of both feet in a jump
    squat: float = 0.7  # height of the hips over the floor
    stand: float = 0.8
    seat: float = 0.35  # ankles ahead of the hips
    bow: float = 35.0  # inclination of the trunk to the front
    lean: float = 11.0  # and to a side
    kick: float = 0.2  # height of the kicking ankle over the other, and its reach
    knee: float = -0.22  # height of a lifted knee over the hips
    lunge: float = 0.5  # distance of the feet, front to back
    lunge_rise: float = 0.82  # height of the hips meanwhile
    punch: float = 0.56  # reach of the fist to the front
    retract: float = 0.7  # distance of fist and shoulder before and after
    point_time: float = 0.4
    clap: float = 0.35  # distance of the wrists
    apart: float = 0.55
    reach_down: float = 0.45  # wrist over the floor


DEFAULT = Thresholds()
