"""Numbers that decide what is wrong with a log, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class QualityConfig:
    """Numbers of the checks that need no model; limits that importers share are in `io.limits`."""

    # clock
    no_time: float = 1e20  # [s] no time stamp: nanoseconds since 1970 are 2e18
    unit_fits: float = 0.02  # relative difference of the steps of t from a sample time
    stale_share: float = 0.05  # of the samples that repeat the one before: fewer do no harm
    stale_together: float = 0.95  # of one channel's repeats that are repeats of all channels
    even: float = 0.5  # sample times by which an interval may differ where no sample is missing
    band: float = 0.81  # cos(2 pi / 10): correlation of steps of q at ten samples a period
    band_next: float = 0.5  # the same of steps two samples apart, to which noise adds nothing
    alternating: float = -0.6  # correlation of less than two samples a period; of noise -1/2
    # samples
    few: float = 0.01  # of the samples that may hold filler values
    gone: float = 0.5  # of the samples missing, above which a channel is no measurement
    step_fits: float = 0.05  # of a step, by which a count may differ from a whole number of steps
    steps_fit: float = 0.98  # of the counts that are whole, from which a step is visible
    distinct: int = 50  # positions that show a coarse step
    coarse: float = 1.5  # times the described encoder step
    few_steps: float = 1000.0  # encoder steps of travel, below which an encoder is coarse
    # glitches and jumps
    glitch: float = 4.0  # times the 99 % quantile of all deviations: 10 standard deviations
    glitch_alone: float = 0.6  # of a glitch, that a line through either side leaves at least
    glitch_sides: float = 0.4  # of a glitch, by which the samples before and after it may differ
    glitch_steps: float = 8.0  # encoder steps, below which no deviation is a glitch
    glitch_torque: float = 0.05  # of the range of a torque, the same
    glitch_limit: float = 0.01  # of the torque limit, the same
    jump: float = 30.0  # times the 99 % quantile of the differences between neighbouring steps
    jump_least: float = 0.02  # [rad] or [m]
    counters: tuple[int, ...] = (12, 13, 14, 16, 17, 18, 19, 20, 24, 32)  # bits of encoders
    turns: int = 2  # turns or counter ranges that may be passed between two samples
    turn_fits: float = 0.05  # of a turn or counter range, by which a wrap may differ from it
    # saturation
    at_limit: float = 0.999  # of the torque limit, from which a torque is at it
    beyond: float = 1.01  # times the limit, from which a torque is a command that the drive cuts
    flat_least: int = 5  # samples of a run at the largest torque
    flat_together: int = 10  # samples of all such runs that make it a limit
    saturated: float = 0.05  # of the samples at the limit that a fit bears
    twice: float = 1.5  # times the limit: a torque constant or gear ratio applied twice?
    # motion
    speed_lag: float = 0.01  # [s] over which speeds are taken, to both sides
    noise: float = 6.0  # standard deviations by which an acceleration is above encoder noise
    limit_slack: float = 1.1  # times a limit that may be reached
    limit_gate: float = 1.5  # times a limit, above which the log fails
    held: float = 0.05  # [rad] or [m] that a held joint may move, or a tenth of the moving one
    moved: float = 0.1  # [rad] or [m] of travel: less is a joint that is held
    one_way: float = 0.02  # of the moving time in one direction, below which it has one direction
    stop_least: float = 0.05  # [s] for which an emergency stop lasts at least
    # references, as shares of a motion
    follows: float = 0.5  # a controller lags and sags by no more
    away: float = 0.8  # a log that is farther off is refused
    others: float = 0.2  # a joint this near to the reference of another follows that
    proportional: float = 0.05  # left beside a multiple of its reference, where it is that
    moves: float = 0.005  # times its reference: what moves less does not; gears are below 200
    at_top: float = 0.02  # of the time at the largest torque, from which that is a limit
    travel: float = 0.01  # [rad] or [m] of a reference that can be followed
    # units
    degrees: float = 12.57  # [rad] two turns, above which angles may be degrees
    often: float = 0.9  # quantile of a torque that is compared with `far`
    far: float = 5.0  # times its limit: a controller that winds up gets there for moments only
    small: float = 0.02  # of the torque limit: no arm uses less of the drives of all its joints


CONFIG = QualityConfig()
