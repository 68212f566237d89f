"""Fit an exact model: Gauss-Newton over every number at once, and the covariance of all.

    fit = refine(model, data, weight)
    fit.residual, fit.covariance()
    torque_gain_of(data, before, after)            residuals of two models on held-out rows

Friction takes power out of a joint: the amplitudes of its laws do not become negative. A negative
viscous friction leaves a little less where it was fitted, and is wrong at every other speed.
Columns are brought to unit length first, so that units do not matter; directions that rounding
makes are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.base import Effect, FrictionLaw
from pipelines.estimation.bootstrap import apart, difference
from pipelines.estimation.exact_model import Exact, Which, slopes_of
from pipelines.estimation.least_squares import Flags, Indices
from pipelines.estimation.nominal import rigid_rows
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_LAGS = 20  # numerics: rows next to each other that share the noise of the low-pass
_ROUNDING = 1e-11  # numerics: of the largest eigenvalue
_ALONE = 1e-9  # numerics: the same: what a block alone tells, the others do not move
_STEPS = 8  # numerics: of Gauss-Newton
_SHARES = (1.0, 0.4, 0.1)  # numerics: of a step, until one leaves less
_RIDGES = (0.0, 1e-4, 1e-2)  # numerics: of unit columns: two numbers alike would move far
_GAIN = 1e-5  # numerics: of the squared residual: less is no progress
_PARTS = 30  # numerics: blocks of time, of about a second: longer than noise remembers
_INVISIBLE = 1e-3  # numerics: η below which a number is one that the others are as well
_STEP = 1e-4  # numerics: of an amplitude or of its deviation, whichever is larger
_BLOCKS = 20  # numerics: of the held-out time
_SEED = 20040509  # numerics
_WORSE = 1.05  # numerics: times the error of a held-out log, that an extension must not exceed


def dissipating(beta: Array, laws: Sequence[Effect]) -> Array:
    """Return `beta`, its last numbers amplitudes of `laws`, with those of friction not below 0."""
    return np.where(_bounded(len(beta), laws), np.maximum(beta, 0.0), beta)


def driving(beta: Array, shift: Array, laws: Sequence[Effect]) -> list[int]:
    """Return the places of friction amplitudes that `shift` would take below zero."""
    there = beta + shift[: len(beta)]
    return np.flatnonzero(_bounded(len(beta), laws) & (there < 0.0)).tolist()


def _bounded(count: int, laws: Sequence[Effect]) -> Flags:
    own = [
        isinstance(law, FrictionLaw) and quantity.low == 0.0
        for law in laws
        for quantity in law.parameters
        if not quantity.shape
    ]
    return np.array([False] * (count - len(own)) + own, dtype=bool)


def solved(table: Array, y: Array, ridge: float = 0.0) -> Array:
    """(k,) coefficients of `table` (k, rows), smallest where rows do not tell."""
    unit, size = _unit(table)
    values, vectors = _seen(unit @ unit.T)
    return np.asarray((vectors / (values + ridge)) @ (vectors.T @ (unit @ y)) / size)


def superfluous(table: Array, wanted: Sequence[int], least: float) -> list[int]:
    """Return the rows of `table` (k, rows), of those wanted, that the others imitate.

    The least visible one goes first, and no longer counts among the others: of two columns
    that are nearly the same one stays (pivoting, as in Golub & Van Loan 2013, ch. 5.4).
    """
    unit, _ = _unit(table)
    gram, left, gone = unit @ unit.T, list(wanted), list[int]()

    def own_part(place: int) -> float:
        """Return the part of a unit column that no combination of the others is, without `gone`."""
        others = np.setdiff1d(np.arange(len(gram)), [place, *gone])
        values, vectors = _seen(gram[np.ix_(others, others)])
        along = vectors.T @ gram[others, place]
        return float(np.clip(gram[place, place] - along @ (along / values), 0.0, 1.0))

    while left:
        seen = [own_part(place) for place in left]
        lowest = int(np.argmin(seen))
        if seen[lowest] >= least**2:
            break
        gone.append(left.pop(lowest))
    return gone


def covariance(table: Array, residual: Array) -> Array:
    """(k, k) of the coefficients of `table` (k, rows), weighted.

    Newey & West 1987 over the rows of each joint, 20 lags: neighbouring rows share the noise of the
    low-pass. Their weights 1 - l / (L + 1) are those of the products of sums over L + 1 rows:

        Σ_l (1 - |l| / (L + 1)) Σ_t s_t s_{t+l}ᵀ = 1 / (L + 1) Σ_t u_t u_tᵀ
        u_t = s_{t-L} + … + s_t
    """
    unit, size = _unit(table)
    values, vectors = _seen(unit @ unit.T)
    bread = (vectors / values) @ vectors.T
    none = np.zeros((len(unit), _LAGS + 1))
    scores = np.concatenate([none, unit * residual, none[:, :_LAGS]], axis=1)
    upto = np.cumsum(scores, axis=1)
    sums = upto[:, _LAGS + 1 :] - upto[:, : -_LAGS - 1]
    meat = sums @ sums.T / (_LAGS + 1)
    return np.asarray(bread @ meat @ bread / size / size[:, None])


def left_out(table: Array, residual: Array, blocks: Indices) -> Array:
    """Return standard deviations (k,) by how the coefficients move where a block is left out.

    The jackknife (Miller 1974), to first order around the solution. What a law of the model lacks
    is no noise: it stays alike for longer than neighbouring rows, and other time asks for other
    numbers. With G = X Xᵀ and s_b = X_b r_b of block b, its leaving moves them by
    -(G - X_b X_bᵀ)⁻¹ s_b.

    Args:
        blocks: (rows,) of time.
    """
    unit, size = _unit(table)
    gram, moved = unit @ unit.T, []
    for block in range(int(blocks.max()) + 1):
        own = unit[:, blocks == block]
        values, vectors = _seen(gram - own @ own.T, _ALONE)
        moved.append((vectors / values) @ (vectors.T @ (own @ residual[blocks == block])))
    return np.asarray(np.sqrt((len(moved) - 1.0) * np.var(moved, axis=0)) / size)


def _unit(table: Array) -> tuple[Array, Array]:
    size = np.linalg.norm(table, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    return table / size[:, None], size


def _seen(gram: Array, least: float = _ROUNDING) -> tuple[Array, Array]:
    values, vectors = np.linalg.eigh(gram)
    keep = values > least * values[-1]
    return values[keep], vectors[:, keep]


@dataclass(frozen=True, eq=False)
class Refined:
    """A model fitted exactly."""

    model: Exact
    data: Data
    weight: Array  # (joints,)
    left: Array  # (rows,) [N m]
    slopes: Array  # (numbers, rows) unweighted
    names: tuple[Which, ...]  # of the slopes after those of the base
    known: Array | None = None  # (numbers, numbers) covariance, where fitted to other rows

    @cached_property
    def weights(self) -> Array:
        """(rows,) of every row."""
        return np.asarray(self.weight[self.data.joint])

    @property
    def residual(self) -> Array:
        """(rows,) weighted."""
        return np.asarray(self.left * self.weights)

    @property
    def rms(self) -> Array:
        """(joints,) [N m]."""
        return self.data.rms(self.left)

    def numbers_of(self, kind: int, place: int) -> list[tuple[int, str]]:
        """Return the slopes of law (kind 0) or effect (1) number `place`, and their names."""
        names = enumerate(self.names, len(self.model.beta))
        return [(k, name) for k, (own, which, name) in names if (own, which) == (kind, place)]

    @cached_property
    def unseen(self) -> list[int]:
        """The slopes of effects that the others imitate: those numbers stay as they were."""
        first = len(self.model.beta)
        if self.known is None:
            return _superfluous(self.slopes * self.weights, first, self.names)
        # where they were fitted they were held
        zero = np.diag(self.known) == 0.0
        return [k for k, name in enumerate(self.names, first) if name[0] == 1 and zero[k]]

    def covariance(self) -> Array:
        """(numbers, numbers): (JᵀJ)⁻¹ with the residual's own autocorrelation allowed for.

        Zero of what is `unseen` and held. Of a number that blocks of time left out in turn move by
        more than that, they give the deviation: noise is not all that is left. Read-only.
        """
        return self._own_covariance if self.known is None else self.known

    @cached_property
    def _own_covariance(self) -> Array:
        seen = np.setdiff1d(np.arange(len(self.slopes)), self.unseen)
        table, residual = (self.slopes * self.weights)[seen], self.residual
        noise = covariance(table, residual)
        std = np.sqrt(np.maximum(np.diag(noise), 1e-300))
        wider = np.maximum(left_out(table, residual, self.data.blocks(_PARTS)) / std, 1.0)
        whole = np.zeros((len(self.slopes), len(self.slopes)))
        whole[np.ix_(seen, seen)] = noise * wider * wider[:, None]
        whole.flags.writeable = False
        return whole


def refine(model: Exact, data: Data, weight: Array, steps: int = _STEPS) -> Refined:
    """Fit by Gauss-Newton with halved steps until the weighted residual no longer falls."""
    y, weights = data.y, weight[data.joint]
    rigid = rigid_rows(data, model.columns)

    def seen(one: Exact) -> tuple[Exact, Array, float, list[Array]]:
        laid = one.laid(data)
        left = y - one.torque(data, laid)
        return one, left, float(np.square(left * weights).sum()), laid

    def better() -> tuple[Exact, Array, float, list[Array]] | None:
        for ridge in _RIDGES:
            try:
                shift = _within(now[0], names, slopes * weights, now[1] * weights, ridge)
            except np.linalg.LinAlgError:  # of numbers at which nothing can be solved: they stay
                return None
            for share in _SHARES:
                tried = seen(now[0].moved(share * shift, names))
                if tried[2] < now[2]:
                    return tried
        return None

    with np.errstate(all="ignore"):  # a step too far may run away: it is not taken then
        now = seen(replace(model, beta=dissipating(model.beta, model.columns.laws)))
        slopes, names = slopes_of(now[0], data, rigid, now[3])
        for _ in range(steps):
            found = better()
            if found is None:
                break
            gained, now = 1.0 - found[2] / now[2], found
            slopes, names = slopes_of(now[0], data, rigid, now[3])
            if gained < _GAIN:
                break
    return Refined(now[0], data, weight, now[1], slopes, tuple(names))


def _within(model: Exact, names: list[Which], table: Array, y: Array, ridge: float) -> Array:
    """Return the step for every number.

    The others do without one that would leave its range, and stays at its end; without friction
    that would drive its joint; and without one of an effect that the rest of the model does as
    well: rounding would move it anywhere.
    """
    first, laws = len(model.beta), model.columns.laws
    stuck = _superfluous(table, first, names)
    shift = _without(table, y, ridge, stuck)
    beyond = []
    for k, (kind, place, name) in enumerate(names, first):
        effect = laws[place] if kind == 0 else model.effects[place].effect
        if not name.isdigit() and effect.at_end(name, float(shift[k])):
            beyond.append(k)
    held = driving(model.beta, shift, laws)
    while beyond or held:
        fixed = y + model.beta[held] @ table[held]
        shift = _without(table, fixed, ridge, [*stuck, *beyond, *held])
        shift[held] = -model.beta[held]
        more = driving(model.beta, shift, laws)  # of those that were free until then
        if not more:
            break
        held = sorted({*held, *more})
    return shift


def _superfluous(table: Array, first: int, names: Sequence[Which]) -> list[int]:
    """Return the numbers of effects, after the `first` of `table`, that others imitate."""
    own = [k for k, (kind, _, _) in enumerate(names, first) if kind == 1]
    return superfluous(table, own, _INVISIBLE)


def _without(table: Array, y: Array, ridge: float, stuck: list[int]) -> Array:
    free = np.setdiff1d(np.arange(len(table)), stuck)
    shift = np.zeros(len(table))
    shift[free] = solved(table[free], y, ridge)
    return shift


def acting(done: Refined, place: int, finite: bool = False) -> Acting:
    """Return effect number `place` with its numbers and their deviations.

    To first order (the delta method) √(s C sᵀ), with slopes s, by one number after the other moved
    a little, and the covariance C of all numbers of the model; ∞ of what follows mostly from a
    number that these logs do not tell from others.

    Args:
        finite: without those that are infinite, as a model has them.
    """
    one, revolute = done.model.effects[place], done.model.columns.body.robot.revolute
    turning = one.effect.joint is None or revolute[one.effect.joint - 1]
    own = done.numbers_of(1, place)
    index = [k for k, _ in own]
    known = done.covariance()[np.ix_(index, index)]
    steps, moved = [], []
    for (_, name), variance in zip(own, np.diag(known), strict=True):
        size = 1.0
        if name.isdigit():
            deviation = float(np.sqrt(max(variance, 0.0)))
            size = max(abs(one.amplitudes[int(name)]), deviation) or 1.0
        steps.append(_STEP * size)
        moved.append(one.moved(name, steps[-1]).values)
    unseen, std = np.isin(index, done.unseen), {}
    for q in one.effect.parameters:
        value = one.values[q.name]
        slope = np.array([difference(value, there[q.name], q.period) for there in moved]) / steps
        if not slope.any() or not np.isfinite(slope).all():
            continue
        share = np.abs(slope)
        hidden = np.where(unseen, share, 0.0).max() > np.where(unseen, 0.0, share).max()
        if not hidden:
            std[q.name] = float(np.sqrt(max(float(slope @ known @ slope), 0.0)))
        elif not finite:
            std[q.name] = np.inf
    return Acting.of(one.effect, one.values, std, revolute=turning)


def with_uncertainty(arm: Arm, done: Refined) -> Arm:
    """Return the arm with the standard deviations of its base parameters and friction laws.

    The shape of a law moves by its logarithm.
    """
    std = np.sqrt(np.maximum(np.diagonal(done.covariance()), 0.0)).tolist()
    columns = done.model.columns
    place = {i: k for k, i in enumerate(columns.kept)}
    numbered = enumerate(arm.base)
    base = tuple(replace(p, std=std[place[i]]) if i in place else p for i, p in numbered)
    laws = [k for k, law in enumerate(columns.laws) if isinstance(law, FrictionLaw)]
    friction = []
    for k, law in zip(laws, arm.friction, strict=True):
        linear = (q.name for q in columns.laws[k].parameters if not q.shape)
        known = dict(zip(linear, std[columns.parts[k]], strict=True))
        for number, name in done.numbers_of(0, k):
            if std[number] > 0.0:
                known[name] = std[number] * abs(getattr(columns.laws[k], name))
        own = tuple(replace(p, std=known.get(p.name, p.std)) for p in law.parameters)
        friction.append(replace(law, parameters=own))
    return replace(arm, base=base, friction=tuple(friction))


@dataclass(frozen=True)
class TorqueGain:
    """Root mean square of the torque residual on held-out equations."""

    before: Array  # [N m]
    after: Array
    ci95: Array  # (joints, 2) [N m] in which `after` - `before` lies with 95 %: blocks drawn again


def torque_gain_of(data: Data, before: Array, after: Array) -> TorqueGain:
    """Return the rms of held-out residuals (rows,) [N m], joint by joint, and its change."""
    place = data.blocks(_BLOCKS)
    count, ci = int(place.max()) + 1, []
    for joint in range(data.n_joints):
        own = (data.joint == joint) & data.counts
        each = (before[own] ** 2, after[own] ** 2, np.ones(int(own.sum())))
        sums = [np.bincount(place[own], x, minlength=count).astype(np.float64) for x in each]
        ci.append(apart(sums[0], sums[1], sums[2], np.random.default_rng(_SEED)))
    return TorqueGain(data.rms(before), data.rms(after), np.array(ci))


def worse_log(data: Data, before: Array, after: Array) -> str:
    """Return in which held-out log the torque error grows, of all joints; empty where in none."""
    for place, one in enumerate(data.logs):
        own = (data.log_of == place) & data.counts
        overall = np.maximum(data.rms(before)[data.joint[own]], 1e-12)
        for scale in (1.0, overall):  # as they are, and each joint in units of its own error
            was, now = (float(np.linalg.norm(x[own] / scale)) for x in (before, after))
            if now > _WORSE * was:
                percent = f"{100.0 * (now / was - 1.0):.0f} % larger"
                return f"the torque error of {one.log.name}, held out, would be {percent}"
    return ""


def no_better(data: Data, before: Array, after: Array) -> str:
    """Return that held-out torque is predicted no better; empty where it is."""
    ratio = data.rms(after) / np.maximum(data.rms(before), 1e-12)
    better = float(np.mean(ratio**2)) < 1.0
    return "" if better else "held-out torque would be predicted no better"
