"""Fit the models of a diagnosis to the rows of role "identify" alone; predict the held-out rows.

    trained = train(prepared, later, causes)
    trained.models                         nominal, with the first cause, …, with all of them
    trained.held_out(0)                    residual of the nominal model on held-out rows
    parameters(fit, place)                 the numbers of a cause, with their standard deviations
    told(effect)                           its reported parameters

A model for simulation has no standing dictionary, but in its place causes that the reference logs
show. The prior is that of its nominal numbers alone,

    N(m_n, (A_nn - A_ns A_ss⁻¹ A_sn)⁻¹),   the marginal of N(m, A⁻¹).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.dataset import Rows
from pipelines.diagnosis.prior import Prior
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import Standing as Told
from pipelines.diagnosis.result import Value
from pipelines.diagnosis.score import confidence_set, log_scores
from pipelines.diagnosis.state import State
from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.estimation.exact_model import Exact, Named, Which, slopes_of
from pipelines.estimation.joint_table import Array, Arrow, Table
from pipelines.estimation.model_fit import Refined, acting, with_uncertainty
from pipelines.estimation.nominal import rigid_rows
from pipelines.estimation.preparation import Prepared
from pipelines.estimation.rows import Data

__all__ = ["Standing", "Trained", "covariance", "parameters", "told", "train"]


def told(acting: Acting) -> dict[str, Value]:
    """Return what is reported of an effect; numbers that belong together are one."""
    found = {}
    for name, value in acting.effect.reported(acting.values).items():
        own = [p for p in acting.parameters if p.name == name]
        own = own or [p for p in acting.parameters if p.name.startswith(f"{name}_")]
        std: float | tuple[float, ...] | None = own[0].std
        if isinstance(value, tuple):
            known = [p.std for p in own]
            std = (
                tuple(np.inf if x is None else x for x in known)
                if any(x is not None for x in known)
                else None
            )
        found[name] = Value(value, std, own[0].unit)
    return found


def parameters(done: Refined, place: int) -> dict[str, Value]:
    """Return what is reported of effect number `place`."""
    return told(acting(done, place))


_UNSEEN = 1e6  # numerics: variance of a number of unit columns, from which the rows do not tell it


@dataclass(frozen=True, eq=False)
class Standing:
    """Baseline effects, and the nominal model that was fitted with them."""

    nominal: Exact
    effects: tuple[Acting, ...] = ()
    told: tuple[Told, ...] = ()
    floor: Array | None = None  # (joints,) [N m] rms residual of the reference; None without one

    def less(self, data: Data) -> Data:
        """Return rows less the torque of the baseline effects."""
        if not self.effects:
            return data
        arm = self.nominal.nominal

        def torque(motion: Motion) -> Array:
            every = [one.effect.torque(motion, arm, one.values) for one in self.effects]
            return np.asarray(np.sum(every, axis=0), dtype=np.float64)

        return replace(data, known=data.lay(torque))


@dataclass(frozen=True, eq=False)
class Trained:
    """Models, each with one cause more than the one before."""

    models: tuple[Refined, ...]  # over the identify rows, as they are logged
    judge: Data | None
    states: tuple[State, ...]  # the same over whitened rows
    later: Later
    blocks: int
    standing: tuple[Acting, ...] = ()  # effects that the models have beside those of their own

    def arm(self, place: int) -> Arm:
        """Return an arm with the baseline effects and every lasting cause, and their deviations."""
        done = self.models[place]
        kept = [k for k, one in enumerate(done.model.effects) if one.log is None]
        own = (acting(done, k, finite=True) for k in kept)
        return with_uncertainty(done.model.nominal.extended(*self.standing, *own), done)

    @property
    def data(self) -> Data:
        """The rows that judge: of role "validate", or else those that were fitted."""
        return self.models[0].data if self.judge is None else self.judge

    def held_out(self, place: int) -> Array:
        """Return the residual (rows,) [N m] of model number `place` on rows it was not fitted to.

        Without validation logs, each block of time is predicted from all others.
        """
        if self.judge is not None:
            return np.asarray(self.judge.y - self.models[place].model.torque(self.judge))
        return self.left_out(place)

    def left_out(self, place: int) -> Array:
        """Return the residual (rows,) [N m] of the fitted rows, each block predicted from others.

        To first order: θ_-b - θ = -(P - J_b J_bᵀ)⁻¹ J_b r_b. An event keeps its numbers, which no
        other block tells.
        """
        done, state = self.models[place], self.states[place]
        first, size = len(done.model.beta), self._sizes(state)
        lasting = np.r_[np.arange(first), first + state.lasting]
        columns = Table.stacked([state.known.base, state.effects]).take(lasting)
        own = _fitted(self.later, state, done.names)
        slopes = (done.slopes[own] / size[:, None])[lasting]
        info = state.known.information(state.effects)[np.ix_(lasting, lasting)]
        block, left = done.data.blocks(self.blocks), done.left.copy()
        parts = [block[done.data.joint == j] for j in range(done.data.n_joints)]
        for b in range(int(block.max()) + 1):
            here = [part == b for part in parts]
            gradient = -columns.moments(state.residual, here)
            step = np.linalg.solve(info - columns.gram(columns, here), gradient)
            left[block == b] -= np.asarray(step @ slopes[:, block == b])
        return left

    def scores(self) -> Array:
        """Return the predictive scores (blocks,) of the torque of the last model, of all joints."""
        data, left = self.models[-1].data, self.left_out(-1)
        block = data.blocks(self.blocks)
        out = np.zeros(int(block.max()) + 1)
        for j in range(data.n_joints):
            own = data.counts & (data.joint == j)
            count = np.bincount(block[own], minlength=len(out)).astype(np.float64)
            losses = np.bincount(block[own], left[own] ** 2, len(out)).astype(np.float64)
            some = count > 0.0
            out[some] += log_scores(losses[some], count[some])
        return out

    def _sizes(self, state: State) -> Array:
        """(numbers,) by which each number is scaled."""
        slopes, _ = self.later.slopes(state.model)
        return np.concatenate([self.later.prior.scale, slopes.lengths])


def train(
    prepared: Prepared, later: Later, causes: Sequence[Named], blocks: int, standing: Standing
) -> Trained:
    """Return the nominal model and those with causes, in their order, without the held-out rows.

    They are fitted to plain rows and to rows that their residual whitens. Whitened rows give the
    numbers the least deviations where the residual is noise (Aitken 1935); where it is what the
    model lacks, they fit bands with little torque. The models of plain rows are returned where
    these predict the torque of left-out blocks of time significantly better.

    Args:
        standing: effects that the models have beside the causes, as the reference has them.
    """
    data = standing.less(prepared.data)
    judge = None if prepared.judge is None else standing.less(prepared.judge)
    rough = Rows.of(data, standing.nominal)

    def fitted(rows: Rows) -> Trained:
        own = _beside(later, rows, standing)
        states = _chain(own, causes)
        weight = 1.0 / data.rms(data.y - states[0].model.torque(data))
        models = tuple(_refined(own, state, data, weight) for state in states)
        return Trained(models, judge, tuple(states), own, blocks, standing.effects)

    left = data.y - _together(_beside(later, rough, standing), causes).torque(data)
    plain = fitted(Rows.of(data, standing.nominal, data.rms(left)))
    white = fitted(rough.whitened(rough.signal(left), later.config.noise_bins)[0])
    return plain if _predicts_better(plain, white) else white


def _predicts_better(one: Trained, other: Trained) -> bool:
    """Return whether models predict left-out blocks of time significantly better than others."""
    try:
        scores = {"one": one.scores(), "other": other.scores()}
    except np.linalg.LinAlgError:  # one block alone tells a number
        return False
    known = all(len(own) > 1 and np.isfinite(own).all() for own in scores.values())
    return known and "other" not in confidence_set(scores, one.later.config)


def _together(own: Later, causes: Sequence[Named]) -> Exact:
    """Return the model with all causes, fitted at once."""
    start = own.start()
    model = replace(start.model, effects=tuple(causes))
    return own.fit(model, start.theta, own.belief_of(model)).model


def _chain(own: Later, causes: Sequence[Named]) -> list[State]:
    """Return the nominal model and those with one cause more each."""
    states = [own.start()]
    for one in causes:
        before = states[-1]
        belief = own.beside(before.belief, one.effect)
        model = replace(before.model, effects=(*before.model.effects, one))
        states.append(own.fit(model, before.theta, belief))
    return states


def _beside(later: Later, rows: Rows, standing: Standing) -> Later:
    """Return rows beside the prior of nominal numbers."""
    dataset = replace(later.dataset, later=rows, model=standing.nominal)
    none = rows.nominal.take(np.zeros(0, dtype=np.intp))
    dictionary = Dictionary((), {}, none, None)
    return Later.of(dataset, dictionary, _nominal(later.prior), later.config)


def _nominal(prior: Prior) -> Prior:
    """Return the marginal prior of the nominal numbers."""
    info, mean = prior.start
    known, n = Arrow.of(info, prior.structure), prior.n_nominal
    own = np.linalg.inv(known.solve(np.eye(len(info), n))[:n])
    own = 0.5 * (own + own.T)
    return prior.nominal(own, mean[:n])


def _refined(later: Later, state: State, data: Data, weight: Array) -> Refined:
    """Return a state over rows as they are logged, with the covariance of all its numbers."""
    model = state.model
    slopes, names = slopes_of(model, data, rigid_rows(data, model.columns))
    fitted = _fitted(later, state, names)
    known = np.zeros((len(slopes), len(slopes)))
    known[np.ix_(fitted, fitted)] = covariance(later, state)
    left = data.y - model.torque(data)
    return Refined(model, data, weight, left, slopes, tuple(names), known)


def _fitted(later: Later, state: State, names: Sequence[Which]) -> list[int]:
    """Return which of all slopes, named `names` behind the linear ones, the state has fitted."""
    first = len(state.model.beta)
    return [*range(first), *(first + names.index(one) for one in later.slopes(state.model)[1])]


def covariance(later: Later, state: State) -> Array:
    """Return the covariance of the nominal numbers and those of the effects, in their own units.

    That of white noise of unit variance, P⁻¹; of a number that blocks of time together tell worse,
    by the scores of the blocks, P⁻¹ Σ_b J_b r_b r_bᵀ J_bᵀ P⁻¹ (White 1980; Liang & Zeger 1986).
    Numbers that the rows do not tell have the variance 0.
    """
    slopes, _ = later.slopes(state.model)
    columns = Table.stacked([state.known.base, state.effects])
    white = state.factor.solve(np.eye(columns.width))
    count = len(later.block_rows)
    scores = np.zeros((columns.width, count))
    for j, residual in enumerate(state.residual):
        weighted = columns.dense(j) * residual
        scores += np.array([np.bincount(later.block[j], row, count) for row in weighted])
    moved = white @ scores
    robust = np.sqrt(np.sum(moved**2, axis=1))
    wider = np.maximum(robust / np.sqrt(np.diag(white)), 1.0)
    numbers = np.r_[np.arange(later.prior.n_nominal), np.arange(later.base.width, len(white))]
    scale = np.r_[later.prior.scale, slopes.lengths]
    wider = wider[numbers] / scale
    out = white[np.ix_(numbers, numbers)] * wider * wider[:, None]
    told = np.diag(white)[numbers] < _UNSEEN
    told[: later.prior.n_nominal] = True
    return np.asarray(out * told * told[:, None])
