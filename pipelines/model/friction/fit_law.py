"""Fit one friction law, the joint's inertia and its gravity to the windows of one or several logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.fit.varpro import SeparableFit, fit_separable, scan, search
from pipelines.model.friction.equations import Equations
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import Law, law_named
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.rigid.body import Array

__all__ = ["fit_law", "roughly", "takes_power"]

_SCANNED = 120  # rows that a scan for starts looks at
_STARTS = 4
_BRIEF = 10  # steps on those rows, before all rows are looked at
_AT_ONCE = 64  # starts: memory
_OTHERS = 8
_ROUGH = 240  # rows of a rough fit
_GLANCED = 80  # rows that its starts are ranked by
_SPARSE = 3  # of the starts it looks at every third
_STEPS = 3  # of a rough fit,
_FIRST = 1  # and of the first one, from the best of its starts
_ROUNDED = 1e-12  # of θ: less is what exp and log make of it
_CARRIED = 3  # rounds in which a law that depends on the load sees the load of the fit before


def fit_law(equations: Equations, law: Law, starts: Sequence[Array] | None = None, sharpness: float | None = None) -> LawFit:
    """Fit `law` from the best of `starts`, which are otherwise the grids of its effects.

    A law that depends on the load sees that of the fit before, round by round.
    """
    arms = equations.arms()
    if law.sees_load:
        arms = equations.arms(fit_law(equations, law_named("coulomb+viscous") or law, None, sharpness).found.beta)
    if starts is None:
        starts = list(law.starts(equations.nodes, arms[0], sharpness))
    begin = list(starts) if len(starts) == 1 else _best_of(equations, law, arms, starts)
    for _ in range(_CARRIED if law.sees_load else 1):
        found = fit_separable(equations.problem(law, arms), begin)
        if not takes_power(equations, law, arms[0], found):
            found = _other(equations, law, arms, starts, found)
        if np.abs((named := law.canonical(found.theta)) - found.theta).max(initial=0.0) > _ROUNDED:
            found = fit_separable(equations.problem(law, arms), [named])
        begin, arms = [found.theta], equations.arms(found.beta)
    return LawFit(law, arms[0], equations.postures, found, equations.width)


def roughly(equations: Equations, law: Law, start: Array | None = None) -> LawFit:
    """A fit of few rows and few steps, from `start` or of many the best: to refine a motion about, or to begin in earnest from."""
    few, arms = equations.thinned(_ROUGH), equations.arms()
    problem = few.problem(law, arms)
    if start is None:
        starts = list(law.starts(equations.nodes, arms[0]))[::_SPARSE]
        end = search(problem, _ranked(equations.thinned(_GLANCED), law, arms, starts)[0], _FIRST)
    else:
        end = search(problem, start, _STEPS)
    return LawFit(law, arms[0], equations.postures, SeparableFit.rough(*end), equations.width)


def takes_power(equations: Equations, law: Law, arm: OneJoint, found: SeparableFit) -> bool:
    """Whether friction is against the motion at every speed up to the fastest, and one that the joint could leave its rest by.

    Two sigmoids nearly alike, one up and one down, fit the speeds there are and may do anything between them and zero. A joint that
    runs came through every lower speed: friction there was no more than the largest torque on it, or than that of the fastest rows,
    which may have been driven when friction had drifted. Of a curve that is not odd only this is required.
    """
    speed = float(np.abs(equations.nodes.dq).max()) * np.geomspace(1e-6, 1.0, 200)
    both = law.curve(np.concatenate([speed, -speed]), arm, found.theta, found.beta[-law.amplitudes:])
    forth, back = np.split(both, 2)
    weight = max(float(np.linalg.norm(one.gravity)) for one in equations.arms(found.beta))
    most = max(equations.largest + weight, abs(float(forth[-1])), abs(float(back[-1])))
    if float(np.abs(both).max()) > most:
        return False
    odd = bool(np.allclose(forth, -back, rtol=1e-9, atol=1e-12))
    return not odd or bool(np.all(forth >= -1e-9 * np.abs(forth).max()))


def _other(equations: Equations, law: Law, arms: Sequence[OneJoint], starts: Sequence[Array], found: SeparableFit) -> SeparableFit:
    """The best of other local optima whose curve takes power; `found` where there is none."""
    whole, few = equations.problem(law, arms), equations.thinned(_ROUGH).problem(law, arms)
    grid = list(starts) if len(starts) > 1 else list(law.starts(equations.nodes, arms[0]))
    ranked = _ranked(equations.thinned(_SCANNED), law, arms, grid)[:_OTHERS]
    ends = sorted((search(few, theta) for theta in ranked), key=lambda end: end[1].rss)
    for theta, _ in ends:
        one = fit_separable(whole, [theta])
        if takes_power(equations, law, arms[0], one):
            return one
    return found


def _best_of(equations: Equations, law: Law, arms: Sequence[OneJoint], starts: Sequence[Array]) -> list[Array]:
    """The best few of many starts by some of the rows, then the best end of a search among those."""
    few = equations.thinned(_SCANNED)
    problem = few.problem(law, arms)
    grid = _ranked(few, law, arms, starts)[:_STARTS]
    ends = sorted((search(problem, theta, _BRIEF) for theta in grid), key=lambda end: end[1].rss)
    return [theta for theta, _ in ends[:1]]


def _ranked(few: Equations, law: Law, arms: Sequence[OneJoint], starts: Sequence[Array]) -> list[Array]:
    """`starts` within the bounds, those first that explain most."""
    grid = np.clip(np.array(starts), *law.bounds)
    left = np.concatenate([scan(few.y, few.fixed, np.stack([few.build(law, arms, theta) for theta in part]))
                           for part in np.array_split(grid, -(-len(grid) // _AT_ONCE))])
    return list(grid[np.argsort(left, kind="stable")])
