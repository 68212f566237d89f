"""Exact fits to the later rows: Levenberg-Marquardt under the prior; score of each block.

later = Later.of(dataset, dictionary, prior, config)
state = later.start()
model, belief = state.model.with_effect(effect, amplitudes), later.beside(state.belief, effect)
state = later.fit(model, state.theta, belief)
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.diagnosis.baseline import Sums
from pipelines.diagnosis.candidates import Dictionary, Group, laid
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows
from pipelines.diagnosis.prior import RIDGE, Belief, Prior, of_any_size, rubs
from pipelines.diagnosis.screening import Screened, price, screen
from pipelines.diagnosis.state import State
from pipelines.diagnosis.unnamed import FORM, Key
from pipelines.effects.base import Effect, FrictionLaw
from pipelines.effects.config import ORDERS
from pipelines.estimation.exact_model import Exact, Named
from pipelines.estimation.joint_table import Array, Arrow, Indices, Table

__all__ = ["Later"]

_STEPS = 20  # numerics: of Levenberg-Marquardt, at most
_FRESH = 3  # numerics: of these, that see anew how effects change what the nominal model does
_DAMPING = (RIDGE, 1e-3, 1e-2, 0.1, 1.0, 10.0)  # numerics: of unit columns, that is tried in turn
_TRIED = np.geomspace(1e-4, 1.0, 40)  # numerics: of its reach, to where an amplitude is moved
_HALF = 0.5  # numerics: of the rows
_PASS_ON = ("drive", "record")  # they act on the torque of all other effects
_SETTLED = 1e-4  # numerics: relative gain of a step, below which the fit has settled


@dataclass(frozen=True, eq=False)
class _Point:
    """One step of a fit."""

    model: Exact
    theta: Array
    residual: tuple[Array, ...]
    cost: float


@dataclass(frozen=True, eq=False)
class Later:
    """The later rows beside the prior."""

    rows: Rows
    dictionary: Dictionary
    prior: Prior
    dataset: Dataset
    config: DiagnosisConfig
    base: Table  # B = [N D]
    candidates: Table  # C
    gram: Array  # B Bᵀ
    cross: Array  # B Cᵀ
    squares: tuple[Array, ...]  # C Cᵀ of each group
    block: tuple[Indices, ...]  # of each joint's rows

    @classmethod
    def of(
        cls,
        dataset: Dataset,
        dictionary: Dictionary,
        prior: Prior,
        config: DiagnosisConfig,
        sums: Sums | None = None,
    ) -> Later:
        """Return the later rows; `sums` are products of their columns, if known."""
        rows = dataset.later
        base = prior.table(rows.nominal, dictionary.later)
        table, gram = dictionary.later, base.gram(base)
        if sums is None:
            sums = base.gram(table), table.squares([g.span for g in dictionary.groups])
        known, block = (rows, dictionary, prior, dataset, config), rows.blocks(config.block)
        return cls(*known, base, table, gram, *sums, block)

    @cached_property
    def block_rows(self) -> Array:
        """(blocks,) rows of each, of all joints."""
        count = 1 + max(int(b.max()) for b in self.block if len(b))
        rows = [np.bincount(b, minlength=count) for b in self.block]
        return np.asarray(np.sum(rows, axis=0), float)

    @cached_property
    def belief(self) -> Belief:
        """The prior of all numbers."""
        return Belief(*self.prior.start, self.base, self.gram, self.prior.structure, self.block)

    def start(self, found: Exact | None = None) -> State:
        """Return the nominal model, or one with causes found before, fitted under the prior."""
        model = found or self.dataset.model
        theta = np.zeros(self.base.width)
        theta[: len(model.beta)] = model.beta * self.prior.scale
        return self.fit(model, theta, self.belief_of(model))

    def belief_of(self, model: Exact) -> Belief:
        """Return the belief for a model with its effects."""
        belief = self.belief
        for one in model.effects:
            belief = self.beside(belief, one.effect)
        return belief

    def fit(self, model: Exact, theta: Array, belief: Belief, steps: int = _STEPS) -> State:
        """Return the model with all its numbers fitted; those of effects have no prior.

        Slopes from fewer samples lead near the fit, those from all of them end it.
        """
        here, known, damping = self._at(model, theta, belief), belief, _DAMPING[0]
        rows = self.rows.coarse
        for k in range(1 + steps):
            rows = rows if k <= steps // 2 else self.rows
            known = self._exact(belief, here.model) if k < _FRESH else known
            there, damping = self._better(here, known, damping, rows, linear=not k)
            gained, here = here.cost - there.cost, there
            if k and gained < 2.0 + _SETTLED * here.cost:
                if rows is self.rows:
                    break
                rows = self.rows
        slopes, names = self.slopes(here.model)
        effects = slopes.scaled(1.0 / slopes.lengths)
        logs = [one.log for one in here.model.effects]
        lasting = [not of_effect or logs[place] is None for of_effect, place, _ in names]
        return State(
            here.model,
            here.theta,
            belief,
            lambda: self._exact(belief, here.model),
            here.residual,
            effects,
            np.flatnonzero(lasting),
            self._read_off(here.model),
        )

    def _at(self, model: Exact, theta: Array, belief: Belief) -> _Point:
        with np.errstate(all="ignore"):  # a step too far may overflow: it is not taken then
            residual = self._residual(model, theta)
            cost = belief.cost(theta, residual) + self._read_off(model)
        return _Point(model, theta, residual, cost)

    def _better(
        self, here: _Point, known: Belief, damping: float, rows: Rows, linear: bool
    ) -> tuple[_Point, float]:
        """Return where a step of Levenberg and Marquardt leads, and the damping of the next one.

        It leads to `here` where no damping leads lower.

        Args:
            linear: move the numbers of the nominal model and amplitudes alone.
        """
        slopes, names = self.slopes(here.model, rows)
        if linear:
            kept = [k for k, (_, _, name) in enumerate(names) if name.isdigit()]
            slopes, names = slopes.take(np.array(kept, dtype=np.intp)), [names[k] for k in kept]
        size = slopes.lengths
        unit = slopes.scaled(1.0 / size)
        gradient = np.r_[known.slope(here.theta, here.residual), unit.moments(here.residual)]
        first = _DAMPING.index(damping)
        for place in range(first, len(_DAMPING)) if names else (0,):
            step = self._step(here.model, known, unit, names, gradient, _DAMPING[place])
            way, more = step[: len(here.theta)], step[len(here.theta) :] / size
            own = way[: self.prior.n_nominal] / self.prior.scale
            there = self._at(here.model.moved(np.r_[own, more], names), here.theta + way, known)
            if np.isfinite(there.cost) and there.cost <= here.cost:
                return there, _DAMPING[max(place - 1, 0)]
            if not place and gradient @ step < 2.0 + _SETTLED * here.cost:  # if linear
                break
        return here, _DAMPING[0]

    def _step(
        self,
        model: Exact,
        known: Belief,
        unit: Table,
        names: Sequence[tuple[int, int, str]],
        gradient: Array,
        damping: float,
    ) -> Array:
        """Return the damped step of all numbers; those at the end of their range stay inside."""
        first = len(gradient) - len(names)
        moving, step = np.arange(len(gradient)), np.zeros(len(gradient))
        while True:
            columns = unit.take(moving[first:] - first)
            step[:] = 0.0
            step[moving] = known.beside(columns, damping).solve(gradient[moving])
            ways = zip(names, step[first:].tolist(), strict=True)
            leaving = [first + k for k, (name, by) in enumerate(ways) if _leaves(model, name, by)]
            if not leaving:
                return step
            moving = np.setdiff1d(moving, leaving)

    def composed(self, model: Exact) -> Later:
        """Return the same with the columns of drives and records beside the effects of a model.

        They pass on the torque of the effects as they do that of the nominal model.
        """
        lasting = tuple(one for one in model.effects if one.log is None)
        both = (self.rows.torque(replace(model, effects=x)) for x in (lasting, ()))
        acting = {1 + j for j, (x, y) in enumerate(zip(*both, strict=True)) if np.any(x != y)}
        keys = [k for k, f in self.dictionary.families.items() if _passes_on(f.shapes, acting)]
        if not keys:
            return self
        families = [self.dictionary.families[key] for key in keys]
        new = Table.stacked([t for one in families for _, t in laid(self.rows, one, model.arm)])
        own = [group for key in keys for group in self.dictionary.groups if group.key == key]
        at = np.concatenate([group.columns for group in own])
        candidates, cross = self.candidates.replaced(at, new), self.cross.copy()
        cross[:, at] = self.base.gram(new)
        squares = dict(zip(self.dictionary.groups, self.squares, strict=True))
        squares |= zip(own, candidates.squares([g.span for g in own]), strict=True)
        return replace(self, candidates=candidates, cross=cross, squares=tuple(squares.values()))

    def screened(self, state: State) -> list[Screened]:
        """Return T_c of every candidate on what the state leaves."""
        cross = self.cross_with(state)
        left = state.factor.solve(state.slope)  # zero where the fit has settled
        moments = self.candidates.moments(state.residual) - cross.T @ left
        found = screen(self.dictionary.groups, state.factor, cross, self.squares, moments)
        if self.dataset.reference is not None:  # else base parameters are free anyway
            found = [self._freely(state, one) for one in found]
        return [self._charged(one) if one.group.reads_torque else one for one in found]

    def cross_with(self, state: State) -> Array:
        """Return the products of the slopes by all numbers of a state with the candidates."""
        base = state.known.base
        nominal = self.cross if base is self.base else base.gram(self.candidates)
        return np.concatenate([nominal, state.effects.gram(self.candidates)])

    def _freely(self, state: State, one: Screened) -> Screened:
        """Return the candidate beside base parameters that it moves by unknown numbers, free."""
        belief = self._free.get(one.group)
        if belief is None:
            return one
        if state.belief is not self.belief:
            belief = self.freed(state.belief, self._effect(one.group))
        columns = self.candidates.take(one.group.columns)
        size = columns.lengths
        belief = self._exact(belief, state.model)
        more = Table.stacked([state.effects, columns.scaled(1.0 / size)])
        slope = np.r_[belief.slope(state.theta, state.residual), more.moments(state.residual)]
        step = belief.beside(more).solve(slope)
        before = state.belief.cost(state.theta, state.residual)
        gain = before - belief.cost(state.theta, state.residual) + float(slope @ step)
        nuisance = self._effect(one.group).nuisance(self.dataset.arm)
        freedom = one.freedom + (0 if nuisance is None else nuisance.shape[1])
        return replace(one, gain=gain, freedom=freedom, amplitudes=step[-len(size) :] / size)

    @cached_property
    def _free(self) -> dict[Group, Belief]:
        """The prior for each candidate that moves base parameters by unknown numbers."""
        named = (g for g in self.dictionary.groups if g.kind == "named")
        every = {g: self.freed(self.belief, self._effect(g)) for g in named}
        return {g: belief for g, belief in every.items() if belief is not self.belief}

    def _effect(self, group: Group) -> Effect:
        return self.dictionary.families[group.key].shapes[group.shape]

    def _charged(self, one: Screened) -> Screened:
        """Return the candidate less the price of the rows that it reads off the log."""
        torque = self.candidates.take(one.group.columns).times(one.amplitudes)
        return replace(one, gain=one.gain - sum(price(x) for x in torque))

    def _read_off(self, model: Exact) -> float:
        """Return the price Σ ln(1 + x²) of rows whose torque x an effect reads off the log itself.

        Such a row is not predicted: it costs a number of its own, of the size x [noise].
        """
        asked = self.rows.data.logs[0].motion.tau is not None
        effects = tuple(
            one for one in model.effects if not (asked and one.effect.parameters.reads_torque)
        )
        if len(effects) == len(model.effects):
            return 0.0
        both = (self.rows.torque(one) for one in (model, replace(model, effects=effects)))
        return sum(price(a - b) for a, b in zip(*both, strict=True))

    def acting(self, state: State) -> Array:
        """Return the share of each joint (joints,) in the torque of all effects.

        An event counts in the whole alone: beyond its moment it leaves nothing.
        """
        effects = state.model.effects
        lasting = self._power(state, [one for one in effects if one.log is None])
        return np.asarray(lasting / max(float(self._power(state, effects).sum()), 1e-300))

    def inexact(self, state: State) -> Array:
        """Return the share (joints,) of effects with an inexact law in the torque of all.

        What changes base parameters acts as the rigid body does, and an event leaves nothing beyond
        its moment.
        """
        effects = state.model.effects
        laws = [o for o in effects if o.log is None and o.effect.evidence != "base parameters"]
        share = self._power(state, laws) / np.maximum(self._power(state, effects), 1e-300)
        return np.asarray(np.minimum(share, 1.0))

    def _power(self, state: State, effects: Sequence[Named]) -> Array:
        """Return the power (joints,) of the torque of some of the effects."""
        models = (replace(state.model, effects=tuple(own)) for own in (effects, ()))
        each = zip(*(self.rows.torque(model) for model in models), strict=True)
        return np.array([float(np.sum((x - y) ** 2)) for x, y in each])

    @property
    def usual(self) -> Array:
        """Length (joints,) of a torque, in units of the noise, that any machine has.

        It is zero with reference logs: they contain what this machine has.
        """
        share = self.config.healthy_share if self.dataset.reference is None else 0.0
        return share * np.array([float(np.linalg.norm(y)) for y in self.rows.y])

    def slight(self, torque: Sequence[Array]) -> bool:
        """Return whether torque is as small as healthy machines have some, at every joint.

        What nominal numbers imitate of it does not count.
        """
        usual = self.usual
        if not usual.any():
            return False
        nominal = self.base.take(np.arange(self.prior.n_nominal))
        part = nominal.times(self._nominal_inverse @ nominal.moments(torque))
        each = zip(torque, part, usual, strict=True)
        return all(float(np.linalg.norm(x - own)) <= least for x, own, least in each)

    @cached_property
    def _nominal_inverse(self) -> Array:
        """(nominal, nominal) of the products of the nominal columns."""
        n = self.prior.n_nominal
        return np.asarray(np.linalg.pinv(self.gram[:n, :n], RIDGE, hermitian=True))

    def form(self, group: Group) -> Effect:
        """Return the first law of a candidate, in the shape that was screened."""
        return self._effect(group).forms()[0]

    @cached_property
    def standing(self) -> Array:
        """(joints,) power of the causes that stand since the reference, in units of the noise.

        Of each joint, what nominal numbers and shapes without a name cannot imitate of its causes:
        m_cᵀ ((P⁻¹)_cc)⁻¹ m_c, P the information of the later rows.
        """
        mean = self.belief.mean
        rows = Arrow.of(self.gram + self.prior.precision, self.prior.structure)
        first, out = self.prior.n_nominal, np.zeros(self.rows.n_joints)
        for j in range(len(out)):
            own = [g.kind != "unnamed" and g.key[1] == j + 1 for g in self.prior.groups]
            at = first + np.flatnonzero(own)
            unit = np.zeros((len(mean), len(at)))
            unit[at, np.arange(len(at))] = 1.0
            out[j] = mean[at] @ np.linalg.solve(rows.solve(unit)[at], mean[at])
        return out

    def taken(self, state: State, groups: Sequence[Group]) -> list[float]:
        """Return what the standing numbers of candidates save.

        Of each s ((P⁻¹)_ss)⁻¹ s, by which the cost would rise without them. They are those of the
        candidate's shape or the next ones; of a cause that stands by its first shape alone, that.
        """
        factor, first, out = state.factor, self.prior.n_nominal, []
        for group in groups:
            shapes = {g.shape for g in self.prior.groups if g.key == group.key}
            away = 0 if group.shape in shapes else 1
            near = {s for s in shapes if len(shapes) == 1 or abs(s - group.shape) == away}
            own = [g.key == group.key and g.shape in near for g in self.prior.groups]
            at = first + np.flatnonzero(own)
            unit = np.zeros((len(state.theta) + state.effects.width, len(at)))
            unit[at, np.arange(len(at))] = 1.0
            spread = factor.solve(unit)[at]
            out.append(float(state.theta[at] @ np.linalg.solve(spread, state.theta[at])))
        return out

    def waves(self, key: Key) -> bool:
        """Return whether the shapes of a cause differ in the order of a wave."""
        family = self.dictionary.families.get(key)
        return family is not None and any(q.several for q in family.shapes[0].parameters)

    def again(self, key: Key) -> bool:
        """Return whether a cause may act more than once at its place."""
        motion, families = self.rows.data.logs[0].motion, self.dictionary.families
        return self.waves(key) and families[key].shapes[0].goes_round(motion, ORDERS.nearly)

    @cached_property
    def shares(self) -> Array:
        """(groups, joints) share of each joint in the columns of a group."""
        power = self.candidates.power
        own = np.array([power[g.columns].sum(axis=0) for g in self.dictionary.groups])
        return np.asarray(own / np.maximum(own.sum(axis=1, keepdims=True), 1e-300))

    def with_columns(self, state: State, columns: Table) -> State:
        """Return the state with further columns, fitted linearly."""
        more = Table.stacked([state.effects, columns.scaled(1.0 / columns.lengths)])
        slope = state.known.slope(state.theta, state.residual)
        step = state.known.beside(more).solve(np.r_[slope, more.moments(state.residual)])
        torque = Table.stacked([state.known.base, more]).times(step)
        residual = tuple(r - t for r, t in zip(state.residual, torque, strict=True))
        lasting = np.append(state.lasting, np.arange(state.effects.width, more.width))
        return replace(
            state,
            theta=state.theta + step[: len(state.theta)],
            residual=residual,
            effects=more,
            lasting=lasting,
        )

    def unchanged(self, state: State, key: Key | None = None) -> State:
        """Return the state refitted with standing numbers at their mean.

        They are those of a cause, or all that healthy machines have in small.
        """
        groups = self.prior.groups
        own = [g.key == key if key else not of_any_size(g) for g in groups]
        at = self.prior.n_nominal + np.flatnonzero(own)
        if not len(at):
            return state
        return self.fit(state.model, state.theta, state.belief.held(at))

    def beside(self, belief: Belief, effect: Effect) -> Belief:
        """Return the belief for a model that contains an effect.

        Without reference logs a friction law, or a drift of friction, cannot be distinguished from
        the form of friction at its joint, which is free: that and the other laws are held at their
        mean.
        """
        if self._as_friction(effect):
            own = [rubs(g) and g.key[1] == effect.joint for g in self.prior.groups]
            belief = belief.held(self.prior.n_nominal + np.flatnonzero(own))
        return self.freed(belief, effect)

    def freed(self, belief: Belief, effect: Effect) -> Belief:
        """Return the belief free along base parameters that the effect moves by unknown numbers."""
        directions = effect.nuisance(self.dataset.arm)
        if directions is None or not directions.shape[1]:
            return belief
        kept = list(self.dataset.model.columns.kept)
        along = np.zeros((self.base.width, directions.shape[1]))
        along[: len(kept)] = directions[kept] * self.prior.scale[: len(kept), None]
        along = along[:, np.linalg.norm(along, axis=0) > 0.0]
        return belief.freed(along / np.linalg.norm(along, axis=0))

    def _exact(self, belief: Belief, model: Exact) -> Belief:
        """Return the belief with the slopes by nominal numbers beside the effects of a model."""
        nominal = self.rows.mixed(model)
        if nominal is None:
            return belief
        return belief.exactly(nominal.scaled(1.0 / self.prior.scale))

    def slopes(
        self, model: Exact, rows: Rows | None = None
    ) -> tuple[Table, list[tuple[int, int, str]]]:
        """Return the slopes by the numbers of the effects in their own units, and their names.

        At the joint of an effect the shape of the friction law is one of them, and of an effect on
        the whole arm that of every law: fitted without the effect, it has taken some of it. Where
        the form of friction is free, the shape says nothing that this does not.

        Args:
            rows: of which; None: of all samples.
        """
        if not model.effects:
            return self.base.take(np.zeros(0, dtype=np.intp)), []
        own = {one.effect.joint for one in model.effects if one.log is None}
        joints = set(range(1, 1 + self.rows.n_joints)) if None in own else own
        held = {one.effect.joint for one in model.effects if self._as_friction(one.effect)}
        return (rows or self.rows).slopes(model, joints - (self._formed - held))

    @cached_property
    def _formed(self) -> set[int | None]:
        """The joints whose form of friction is free."""
        free = self.dataset.reference is None
        return {g.key[1] for g in self.prior.groups if free and g.key[0] == FORM}

    def _as_friction(self, effect: Effect) -> bool:
        """Return whether an effect cannot be distinguished from the form of friction."""
        law = isinstance(effect, FrictionLaw) or effect.clock == "session"
        return law and self.dataset.reference is None

    def _residual(self, model: Exact, theta: Array) -> tuple[Array, ...]:
        standing = theta.copy()
        standing[: self.prior.n_nominal] = 0.0
        torque = self.rows.torque(model)
        return tuple(
            y - t - s
            for y, t, s in zip(self.rows.y, torque, self.base.times(standing), strict=True)
        )


def _leaves(model: Exact, name: tuple[int, int, str], by: float) -> bool:
    """Return whether a number is at the end of its range, and `by` points out of it."""
    of_effect, place, number = name
    owner = model.effects[place].effect if of_effect else model.columns.laws[place]
    return owner.at_end(number, by)


def _passes_on(shapes: Sequence[Effect], acting: Collection[int]) -> bool:
    """Return whether a cause passes on, to the drive or the record, torque of some joints."""
    one = shapes[0]
    if one.acts_on not in _PASS_ON:
        return False
    others = (getattr(shape, q.name) for shape in shapes for q in one.parameters if q.joint)
    return one.joint in acting or any(int(joint) in acting for joint in others)
