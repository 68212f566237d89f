"""Numbers that decide in the fit of friction, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DriftConfig", "FindingsConfig", "FitConfig", "FolderConfig", "JointConfig"]
__all__ += ["LadderConfig", "RefineConfig", "SimulationConfig", "SlidingConfig", "SpeedConfig"]
__all__ += ["WeakFormConfig"]


@dataclass(frozen=True)
class WeakFormConfig:
    """Limits of samples that make equations, of their nodes, and of joints that move."""

    vague: float = 2.0  # times the usual std of the speed: near ends and gaps; a choice
    sway: float = 10.0  # encoder steps: rounding moves a held joint by one
    fast: float = 3.0  # std of a speed: a slower one (rms) may be zero (two-sided .003)
    fewest: int = 10  # windows of a stretch that is worth using: a choice, not measured
    shortest: int = 4  # samples of a window: a choice, not measured
    parts: int = 8  # nodes of an interval in which speed passes zero
    near: float = 2.0  # changes of speed in a sample: nearer to zero its sign may turn over
    little: float = 1e-4  # of the fastest speed: slower creep does not need its every sample
    steady: float = 8.0  # times its std: a mean speed that keeps its sign and most of its size
    pair: int = 3  # samples, from which two nodes replace them
    coarsest: float = 1e-2  # [s] of the samples that two nodes replace


@dataclass(frozen=True)
class FitConfig:
    """Where searches begin, and what a fit shows."""

    scanned: int = 120  # rows that a scan for starts looks at
    starts: int = 4  # of them, searched on these rows
    brief: int = 10  # steps of those searches
    at_once: int = 64  # starts of a scan: memory
    others: int = 8  # starts where the best curve gives power back
    rough: int = 240  # rows that these are searched on
    rounded: float = 1e-12  # of θ: less is rounding of exp and log
    carried: int = 3  # rounds in which a law that depends on the load sees that of the fit before
    seen: float = 0.9  # share of a number in directions that the rows show: it is known
    alike: float = 0.02  # [rad] by which locked joints may differ and the inertia be the same


@dataclass(frozen=True)
class LadderConfig:
    """Limits of a measurable difference between laws."""

    sure: float = 2.0  # standard errors of a difference, beyond which it is one: two-sided .05
    worth: float = 0.01  # of the mean square: a smaller difference does not count, .5 % rms
    blocks: int = 20  # of the rows that judge, whose sums give a deviation: known to a sixth
    folds: int = 10  # of the rows, each held out in turn (Kohavi 1995, IJCAI, p. 1137)
    further: int = 2  # causes after the first
    more: float = 0.1  # of the residual (mean square), the least that each of these explains
    hopeful: int = 3  # of them that are fitted at a time: they explain most to first order
    points: int = 60  # speeds, each way, at which curves are compared


@dataclass(frozen=True)
class JointConfig:
    """Numbers of the fit of one joint."""

    memory: float = 1.0  # [s] over which errors of a law may depend: a joint moves some way in it
    courses: int = 3  # rounds of fitting a curve and its change
    curve: int = 100  # points of a curve, each way, from 1e-3 of the fastest speed on


@dataclass(frozen=True)
class SlidingConfig:
    """Limits of sliding; judged on seeds never seen before by benchmarks.friction_nuisances."""

    rest: float = 3.0  # standard deviations: a slower speed may be zero (two-sided .003)
    # Median square of a class over that of the first rows: 3 std of the logarithm of that of
    # 25 normal errors, exp(3 · 2.34/√25) (Kendall & Stuart 1977, eq. 10.29)
    worse: float = 4.0
    good: float = 0.03  # of friction: what a law is good for; `margin` leaves its fourth power
    rows: int = 3  # for every column of the free curve, that the first class has at least
    margin: float = 4.0  # times the travel: bristles straighten as exp(-travel) (Dahl 1968), 2 %
    classes: int = 5  # of speed, a decade: friction runs straight over a factor of 1.6
    decades: int = 4  # of speed; slower rows are one class
    course: int = 8  # knots of friction in time: what drifts still is a function of speed
    halving: float = 2.0  # of travel, from class to class
    windows: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)  # times the shortest, tried in turn
    attenuation: float = 2e-3  # noise of the acceleration over itself (variance): bias of inertia


@dataclass(frozen=True)
class DriftConfig:
    """Limits of friction that drifts."""

    chance: float = 1e-3  # to gain as much in blocks held out without a drift: none in 100 joints
    block: float = 0.5  # [s] in which errors depend; .1 s apart they do by .15 (10 joints, one .28)
    fewest: int = 12  # blocks: fewer give no covariance of two numbers to rely on
    rows: int = 3  # for every other column: fewer leave no residual to judge by
    ends: float = 0.08  # of all rows, that lie before and after a step
    times: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8, 1.5, 5.0)  # over the duration; 5: straight
    least: float = 0.03  # of friction: a smaller change is within what a law is good for
    sure: float = 2.0  # std by which a change is known, or a larger one excluded: two-sided .05
    rounds: int = 4  # of scanning for a course and fitting the curve that changes


@dataclass(frozen=True)
class RefineConfig:
    """Numbers of a refined motion, and of the rough fit that it is first refined about."""

    least: float = 1e-6  # of the torque: its noise, where a fit leaves none
    share: int = 4  # samples that a window keeps for the rough fit
    shortest: int = 4  # samples of a window
    fewest: int = 10  # windows
    ends: float = 0.05  # [s] at either end, where no later or earlier sample helps the smoother
    order: int = 3  # of the smoother that the motion begins with
    freedom: float = 2.0  # a rough fit draws the motion to its errors: twice the noise halves that
    rough: int = 240  # rows of a rough fit
    glanced: int = 80  # rows that its starts are ranked by
    sparse: int = 3  # of the starts it looks at every third
    steps: int = 3  # of a rough fit from a fit before
    first: int = 1  # of the first one, from the best of its starts


@dataclass(frozen=True)
class SimulationConfig:
    """Numbers of the simulation of a joint."""

    stable: float = 1.0  # of step × slope / J: a fourth-order Runge-Kutta step is stable to 2.7
    most_steps: int = 20  # a sample
    fastest: float = 1e4  # [rad/s] beyond it the simulation has run away


@dataclass(frozen=True)
class SpeedConfig:
    """Classes of speed, and what logs should cover."""

    classes: int = 5  # of speed, a decade
    enough: int = 5  # rows that fill a class
    decades: float = 1.6  # and
    speeds: int = 7  # classes each way that are enough
    vague: float = 0.5  # of a value, its standard deviation: hardly known


@dataclass(frozen=True)
class FindingsConfig:
    """When a fit shows that its logs are wrong, and what it may leave."""

    sure: float = 3.0  # std below zero (two-sided .003)
    far: float = 2.0  # times the inertia of the described links; a choice, not measured
    nothing: float = 0.01  # of the torque (std): no gravity; a choice, not measured
    coarse: float = 0.05  # bias of the inertia by errors in variables; a choice, not measured
    poor: float = 0.5  # of the held-out torque (rms): a quarter of its power is not described


@dataclass(frozen=True)
class FolderConfig:
    """The model that the logs of a folder give."""

    window: float = 0.02  # [s] of the equations of friction
    dear: float = 1e-3  # of the error, by which each further number must lower it
