"""Numbers that decide in the fit of friction, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FRICTION"]


@dataclass(frozen=True)
class FrictionConfig:
    """Numbers of the equations, the fit, the choice among laws, and what is said of a joint."""

    # equations over windows
    window: float = 0.02  # [s] the shortest window
    windows: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)  # times the shortest, tried in turn
    fewest: int = 10  # windows of a stretch that is worth using: a choice, not measured
    shortest: int = 4  # samples of a window: a choice, not measured
    vague: float = 2.0  # times the usual std of the speed: near ends and gaps; a choice
    sway: float = 10.0  # encoder steps: rounding moves a held joint by one
    fast: float = 3.0  # std of a speed: a slower one (rms) may be zero (two-sided .003)
    alike: float = 0.02  # [rad] by which locked joints may differ and the inertia be the same
    # nodes of the integrals
    parts: int = 8  # nodes of an interval in which speed passes zero
    near: float = 2.0  # changes of speed in a sample: nearer to zero its sign may turn over
    little: float = 1e-4  # of the fastest speed: slower creep does not need its every sample
    # search
    scanned: int = 120  # rows that a scan for starts looks at
    starts: int = 4  # of them, searched on these rows
    brief: int = 10  # steps of those searches
    at_once: int = 64  # starts of a scan: memory
    others: int = 8  # starts where the best curve gives power back
    rough: int = 240  # rows that these are searched on
    rounded: float = 1e-12  # of θ: less is rounding of exp and log
    carried: int = 3  # rounds in which a law that depends on the load sees that of the fit before
    seen: float = 0.9  # share of a number in directions that the rows show: it is known
    # choice of the law
    sure: float = 2.0  # standard errors of a difference, beyond which it is one: two-sided .05
    worth: float = 0.01  # of the mean square: a smaller difference does not count, .5 % rms
    more: float = 0.1  # of the residual (mean square), that a law of several causes explains more
    blocks: int = 20  # of the rows that judge, whose sums give a deviation: known to a sixth
    folds: int = 10  # of the rows, each held out in turn (Kohavi 1995, IJCAI, p. 1137)
    points: int = 60  # speeds, each way, at which curves are compared
    classes: int = 5  # of speed, a decade: friction runs straight over a factor of 1.6
    filled: int = 5  # rows that fill a class
    decades: float = 1.6  # of speed, and
    speeds: int = 7  # classes each way that are enough
    doubtful: float = 0.5  # of a value, its standard deviation: hardly known
    # sliding; judged on seeds never seen before by benchmarks.friction_nuisances
    rest: float = 3.0  # standard deviations: a slower speed may be zero (two-sided .003)
    # Median square of a class over that of the first rows: 3 std of the logarithm of that of
    # 25 normal errors, exp(3 · 2.34/√25) (Kendall & Stuart 1977, eq. 10.29)
    worse: float = 4.0
    good: float = 0.03  # of friction: what a law is good for; `margin` leaves its fourth power
    rows: int = 3  # for every column of a free curve, that it is fitted to at least
    margin: float = 4.0  # times the travel: bristles straighten as exp(-travel) (Dahl 1968), 2 %
    slowest: int = 4  # decades of speed; slower rows are one class
    course: int = 8  # knots of friction in time: what drifts still is a function of speed
    halving: float = 2.0  # of travel, from class to class
    attenuation: float = 2e-3  # noise of the acceleration over itself (variance): bias of inertia
    memory: float = 1.0  # [s] over which errors of a law may depend: a joint moves some way in it
    # drift
    chance: float = 1e-3  # to gain as much in blocks held out without a drift: none in 100 joints
    block: float = 0.5  # [s] in which errors depend; .1 s apart they do by .15 (10 joints, one .28)
    few_blocks: int = 12  # fewer give no covariance of two numbers to rely on
    times: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8, 1.5, 5.0)  # over the duration; 5: straight
    least: float = 0.03  # of friction: a smaller change is within what a law is good for
    rounds: int = 4  # of scanning for a course and fitting the curve that changes
    curve: int = 100  # points of a curve, each way, from 1e-3 of the fastest speed on
    # refined motion
    noise: float = 1e-6  # of the torque: its noise, where a fit leaves none
    # simulation
    stable: float = 1.0  # of step × slope / J: a fourth-order Runge-Kutta step is stable to 2.7
    most_steps: int = 20  # a sample
    fastest: float = 1e4  # [rad/s] beyond it the simulation has run away
    # findings
    negative: float = 3.0  # std below zero (two-sided .003)
    coarse: float = 0.05  # bias of the inertia by errors in variables; a choice, not measured
    poor: float = 0.5  # of the held-out torque (rms): a quarter of its power is not described
    # the model of a folder
    dear: float = 1e-3  # of the error, by which each further number must lower it


FRICTION = FrictionConfig()
