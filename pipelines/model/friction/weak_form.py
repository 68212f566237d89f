"""Equations of one moving joint without its acceleration: what torque adds to its momentum, window by window.

Integrated over a window [a, b], eq. (11) of Kostić et al. 2004 reads

    J (dq(b) - dq(a)) + ∫ (c sin q + c' cos q + τ_f) dt = ∫ τ dt

No acceleration has to be reconstructed, a held command is integrated exactly, and a sign change of friction, which smears
an acceleration over the reach of every filter, is a kink of the speed at a known instant. Divided by its length, a row is a
mean torque [N m]. The integrals are sums over nodes (nodes.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.friction.nodes import Nodes, lay_nodes
from pipelines.model.friction.one_joint import gravity_acts, gravity_columns
from pipelines.model.friction.sway import Sway, sway_columns
from pipelines.model.motion import Reconstructed, encoder_resolution
from pipelines.model.rigid.body import Array, Motion
from pipelines.signal.observer import design
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import tune_jerk

__all__ = ["Course", "Stretch", "Windows", "blocks_of_time", "moved", "stretches_of", "swaying"]

_MOTIONLESS = ("edges", "usable", "impulse", "length", "torque")
_PART = 1e-3  # of a finite difference, relative
_KINKED = 2  # order of a smoother for motion whose acceleration jumps


@dataclass(frozen=True)
class WeakFormConfig:
    """Which samples and stretches make equations, and which joints move."""

    vague: float = 2.0  # times the usual std of the speed: near ends and gaps; a choice
    sway: float = 10.0  # encoder steps: rounding moves a held joint by one
    fast: float = 3.0  # std of a speed: a slower one (rms) may be zero (two-sided .003)
    fewest: int = 10  # windows of a stretch that is worth using: a choice, not measured
    shortest: int = 4  # samples of a window: a choice, not measured


_CONFIG = WeakFormConfig()


@dataclass(frozen=True, eq=False)
class Windows:
    """Nodes, and the windows over which columns are averaged."""

    nodes: Motion  # (nodes, 1)
    share: Array  # (nodes,) time that a node stands for over the length of its window
    first: npt.NDArray[np.intp]  # (windows,) first node of every window
    kept: npt.NDArray[np.bool_]  # (windows,) whether it makes a row

    def means(self, columns: Array) -> Array:
        """Of columns (nodes, k): (rows, k)."""
        return np.asarray(np.add.reduceat(columns * self.share[:, None], self.first, axis=0)[self.kept])

    def some(self, every: int) -> Windows:
        """Every so-manieth row, with its own nodes alone."""
        chosen = np.flatnonzero(self.kept)[::every]
        count = np.diff(np.append(self.first, len(self.share)))[chosen]
        begin = np.concatenate([[0], np.cumsum(count)[:-1]])
        index = np.repeat(self.first[chosen] - begin, count) + np.arange(count.sum())
        motion = self.nodes
        nodes = Motion(motion.t[index], motion.q[index], motion.dq[index], motion.ddq[index])
        return Windows(nodes, self.share[index], begin, np.ones(len(chosen), dtype=bool))


@dataclass(frozen=True, eq=False)
class Course:
    """Friction that changes in time by α c(t) g(v)."""

    kind: str  # "trend" | "step"
    form: str  # g: "whole", the curve of friction; "viscous", v; "coulomb", its sign
    starts: tuple[float, ...]  # [s] first instant of every stretch
    time: float  # [s] since the start: of a step when; of a trend its time constant
    holds: float  # [s] since the start: where c is zero, of a trend
    until: float  # [s] duration of a trend's log; of a step when
    part: int = 0  # stretch of a step
    curve: tuple[Array, Array] | None = None  # speeds [rad/s] and torques [N m] of friction
    change: float = 0.0  # α of the fit before, of a trend: beside c g then stands α ∂c/∂(ln T) g, and T is fitted
    named: bool = True  # shown by the rows; else neither shown nor excluded

    def at(self, part: int, t: Array) -> Array:
        """c(t) in one of the stretches: it rises by one."""
        since = t - self.starts[part]
        if self.kind == "step":
            return np.where(part > self.part, 1.0, np.where(part < self.part, 0.0, (since >= self.time) * 1.0))
        return self._risen(since, self.time)

    def _risen(self, since: Array, time: float) -> Array:
        """(exp(-h/T) - exp(-t/T)) / (1 - exp(-D/T))"""
        return np.asarray((np.exp(-self.holds / time) - np.exp(-since / time)) / -np.expm1(-self.until / time))

    def shape(self, v: Array) -> Array:
        """g(v) [N m], [rad/s] or 1."""
        if self.form == "viscous":
            return v
        return np.sign(v) if self.form == "coulomb" or self.curve is None else np.interp(v, *self.curve)

    def columns(self, part: int, t: Array, dq: Array) -> Array:
        """c(t) g(v), and α ∂c/∂(ln T) g, over the step after each sample (samples, 1 or 2); the last row is zero."""
        middle = 0.5 * (t[1:] + t[:-1])
        courses = [self.at(part, middle)]
        if self.change != 0.0:
            since = middle - self.starts[part]
            ends = [self._risen(since, self.time * (1.0 + side * _PART)) for side in (1.0, -1.0)]
            courses.append(self.change * (ends[0] - ends[1]) / (2.0 * _PART))
        value = np.stack(courses, axis=1) * self.shape(0.5 * (dq[1:] + dq[:-1]))[:, None]
        return np.vstack([value, np.zeros((1, len(courses)))])


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples of one joint without a gap, and the windows its equations are taken over."""

    name: str  # of the log
    t: Array  # [s] (samples,)
    measured: Array  # [rad] (samples,) position as the encoder gave it, NaN where it is missing
    tau: Array  # [N m] (samples,)
    q: Array  # [rad] (samples,) reconstructed
    dq: Array  # [rad/s] (samples,)
    spoilt: npt.NDArray[np.bool_]  # (samples,) no row may use it
    held: bool  # the torque is a command held from sample to sample
    window: int  # samples
    revolute: bool
    posture: tuple[float, ...]  # [rad] of the other joints
    beside: tuple[Sway, ...] = ()  # joints that are held and give way
    speed_std: float = 0.0  # [rad/s] of the reconstructed speed
    weighs: bool = True  # gravity acts about the joint's axis
    sticks: npt.NDArray[np.bool_] | None = None  # (windows,) the joint does not slide: no row of a sliding law

    course: Course | None = None  # of friction that changes in time
    lag: tuple[Array, Array] | None = None  # speeds [rad/s] and torques [N m] of the part of friction that lags behind its speed
    untimed: bool = False  # the torque is measured: when within its step it acted is not known
    part: int = 0  # which of its stretches this is

    def only(self, rows: npt.NDArray[np.bool_]) -> Stretch:
        """The same with some of its usable rows (usable rows,); itself as first made with all."""
        sticks = np.zeros(len(self.usable), dtype=bool)
        sticks[self.usable] = ~rows
        return replace(self, sticks=sticks if sticks.any() else None)

    def moved(self, q: Array, dq: Array) -> Stretch:
        """The same with a better motion; what does not depend on that is kept."""
        other = replace(self, q=q, dq=dq)
        other.__dict__.update({name: self.__dict__[name] for name in _MOTIONLESS if name in self.__dict__})
        return other

    @property
    def rows(self) -> int:
        return int(self.kept.sum())

    @cached_property
    def edges(self) -> npt.NDArray[np.intp]:
        """Samples at which windows begin and end."""
        return np.arange(0, len(self.t), self.window)

    @cached_property
    def usable(self) -> npt.NDArray[np.bool_]:
        """(windows,) nothing in it is spoilt."""
        bad = np.concatenate([[0], np.cumsum(self.spoilt)])
        return np.asarray(bad[self.edges[1:] + 1] == bad[self.edges[:-1]])

    @property
    def kept(self) -> npt.NDArray[np.bool_]:
        """(windows,) usable, and not left out as sticking."""
        return self.usable if self.sticks is None else self.usable & ~self.sticks

    @cached_property
    def impulse(self) -> Array:
        """∫ τ dt from the first sample (samples,) [N m s]."""
        tau = np.where(np.isfinite(self.tau), self.tau, 0.0)
        each = tau[:-1] if self.held else 0.5 * (tau[1:] + tau[:-1])
        return np.concatenate([[0.0], np.cumsum(each * np.diff(self.t))])

    @cached_property
    def length(self) -> Array:
        """(windows,) [s]"""
        return np.diff(self.t[self.edges])

    @cached_property
    def torque(self) -> Array:
        """Mean torque of every window that is kept (rows,) [N m]."""
        return np.asarray((np.diff(self.impulse[self.edges]) / self.length)[self.kept])

    @cached_property
    def rigid(self) -> Array:
        """Columns of J, of gravity, and of the sway of joints that are held: (rows, width)."""
        mean = np.diff(self.dq[self.edges]) / self.length
        gravity = self.windows.means(gravity_columns(self.nodes.q[:, 0], self.revolute) * float(self.weighs))
        columns = [mean[self.kept, None], gravity]
        if self.sway.shape[1]:
            sway = np.diff(self.swayed[self.edges], axis=0) / self.length[:, None]
            if self.untimed:
                sway[:, 0] = self._timing
            columns.append(sway[self.kept])
        return np.hstack(columns)

    @property
    def _timing(self) -> Array:
        """(windows,) mean change of torque in a step, from the samples next to each window: their noise is not in its own mean."""
        known = np.where(np.isfinite(self.tau), self.tau, 0.0)
        before = np.maximum(self.edges[:-1] - 1, 0)
        before = np.where(np.isfinite(self.tau[before]), before, self.edges[:-1])
        return np.asarray((known[self.edges[1:]] - known[before]) / (self.edges[1:] - before))

    @cached_property
    def laid(self) -> Nodes:
        """Where the integrals are summed."""
        return lay_nodes(self.t, self.q, self.dq, self.window)

    @property
    def ends(self) -> Array:
        """Times between the nodes [s] (nodes + 1,)."""
        return self.laid.ends

    @property
    def nodes(self) -> Motion:
        return self.laid.motion

    @cached_property
    def windows(self) -> Windows:
        """Where the nodes lie in the windows that are kept."""
        first = np.searchsorted(self.laid.sample, self.edges)
        length = np.full(len(self.ends) - 1, np.inf)
        length[:first[-1]] = np.repeat(self.length, np.diff(first))
        return Windows(self.nodes, np.diff(self.ends) / length, first[:-1], self.kept)

    @cached_property
    def sway(self) -> Array:
        """Columns beside inertia and gravity over the step after each sample (samples, columns).

        Of a torque sample that may act a part of a step later or earlier, its change over the step; of joints that are held and
        sway; of friction that lags behind its speed; and of friction that changes in time.
        """
        parts = [sway_columns(self.t, self.q, self.dq, self.beside, self.revolute)]
        if self.untimed:
            known = np.where(np.isfinite(self.tau), self.tau, 0.0)
            parts.insert(0, np.append(np.diff(known), 0.0)[:, None])
        if self.lag is not None:
            level = np.interp(self.dq, *self.lag)
            parts.append(np.append(np.diff(level) / np.diff(self.t), 0.0)[:, None])
        if self.course is not None:
            parts.append(self.course.columns(self.part, self.t, self.dq))
        return np.hstack(parts)

    @cached_property
    def swayed(self) -> Array:
        """∫ sway dt from the first sample (samples, columns)."""
        return np.vstack([np.zeros((1, self.sway.shape[1])), np.cumsum(self.sway[:-1] * np.diff(self.t)[:, None], axis=0)])

    def accumulated(self, values: Array) -> Array:
        """∫ values dt of values (nodes,) from the first sample, at every sample."""
        whole = np.concatenate([[0.0], np.cumsum(values * np.diff(self.ends))])
        return np.asarray(np.interp(self.t, self.ends, whole))

    @cached_property
    def middle(self) -> tuple[Array, Array, Array]:
        """Position, speed and time of every row (rows,), as means over its window."""
        mean = self.windows.means(np.hstack([self.nodes.q, self.nodes.dq, self.nodes.t[:, None]]))
        return mean[:, 0], mean[:, 1], mean[:, 2]


def blocks_of_time(stretches: Sequence[Stretch], length: float) -> npt.NDArray[np.intp]:
    """Number of the block of `length` seconds that each row is in (rows,), from 0."""
    codes = [10**7 * k + np.floor((stretch.middle[2] - stretch.t[0]) / length) for k, stretch in enumerate(stretches)]
    return np.asarray(np.unique(np.concatenate(codes), return_inverse=True)[1], dtype=np.intp)


def swaying(found: Reconstructed, joint: int, resolution: Array) -> tuple[int, ...]:
    """Joints, counted from 1, that are held in the log but visibly give way."""
    q = found.motion.q[found.good.kept[found.good.fit]]
    moved = np.ptp(q, axis=0) > _CONFIG.sway * resolution
    return tuple(int(k) + 1 for k in np.flatnonzero(moved) if k != joint - 1)


def moved(seen: Sequence[Reconstructed]) -> npt.NDArray[np.bool_]:
    """(joints,) whether any log moves a joint further than its encoder's steps, and faster than noise alone would have it."""
    found = []
    for one in seen:
        rows = one.good.kept[one.good.fit]
        moves = np.ptp(one.motion.q[rows], axis=0) > _CONFIG.sway * encoder_resolution(one.good)
        if one.std is not None:
            speed = np.sqrt(np.nanmean(np.square(one.motion.dq[rows]), axis=0))
            moves &= speed > _CONFIG.fast * np.nanmedian(one.std[1][rows], axis=0)
        found.append(moves)
    return np.asarray(np.any(found, axis=0))


def stretches_of(log: ExperimentLog, joint: int, found: Reconstructed, window: float,
                 beside: Sequence[int] = ()) -> tuple[Stretch, ...]:
    """What of `log` can be used for its joint `joint`, counted from 1, in windows of `window` [s].

    Args:
        beside: joints that are held and sway.
    """
    good, j = found.good, joint - 1
    others = tuple(float(np.nanmedian(good.log.q[:, k])) for k in range(log.n_joints) if k != j)
    size = max(_CONFIG.shortest, round(window / log.sample_time))
    motion, stretches = found.motion, []
    weighs = gravity_acts(log.robot, joint, others)
    for run in good.runs:
        rows = good.kept[run]
        q, dq = motion.q[rows, j], motion.dq[rows, j]
        sways = tuple(_sway(found, run, rows, k - 1, log.sample_time, k - 1 < j) for k in beside)
        spoilt = (good.missing | good.spikes | good.saturated)[run, j] | ~np.isfinite(q + dq)
        doubt = 0.0
        if found.std is not None:
            speed = found.std[1][rows, j]
            spoilt |= speed > _CONFIG.vague * np.nanmedian(found.std[1][:, j])
            doubt = float(np.nanmedian(speed))
        measured = np.where(good.position_spikes[run, j], np.nan, good.log.q[run, j])
        stretch = Stretch(log.name, good.log.t[run], measured, good.log.tau[run, j], np.where(np.isfinite(q), q, 0.0),
                          np.where(np.isfinite(dq), dq, 0.0), spoilt, True, size,
                          log.robot.joints[j].revolute, others, sways, doubt, weighs,
                          untimed=log.torque == "measured")
        if len(stretch.edges) > _CONFIG.fewest and stretch.rows >= _CONFIG.fewest:
            stretches.append(stretch)
    return tuple(stretches)


def _sway(found: Reconstructed, run: slice, rows: npt.NDArray[np.intp], k: int, step: float, nearer: bool) -> Sway:
    """The sway of joint `k`, counted from 0. Torque of the driven joint comes in steps: its speed has kinks."""
    good = found.good
    seen = np.where(good.position_spikes[run, k], np.nan, good.log.q[run, k])
    lean = seen - np.nanmedian(good.log.q[:, k])
    try:
        tuned = tune_jerk(lean[:, None], step, encoder_resolution(good)[[k]], _KINKED)
    except InputRejected:
        return Sway(found.motion.q[rows, k] - np.nanmedian(good.log.q[:, k]), found.motion.dq[rows, k], nearer)
    states = smooth(lean[:, None], design(step, tuned.jerk_std, tuned.noise_variance, _KINKED)).states
    return Sway(states[0, :, 0], states[1, :, 0], nearer)
