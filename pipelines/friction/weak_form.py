"""Equations of one moving joint without its acceleration: momentum that torque adds, by windows.

Integrated over a window [a, b], eq. (11) of Kostić et al. 2004 reads

    J (dq(b) - dq(a)) + ∫ (c sin q + c' cos q + τ_f) dt = ∫ τ dt

No acceleration has to be reconstructed, a held command is integrated exactly, and a sign change of
friction, which smears an acceleration over the reach of every filter, is a kink of the speed at a
known instant. Divided by its length, a row is a mean torque [N m].

The integrals are sums over nodes: one a sample's interval, eight where speed passes zero in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.errors import InputRejected
from pipelines.estimation.motion import Reconstructed, encoder_resolution
from pipelines.estimation.state_estimation import design, smooth
from pipelines.estimation.tuning import tune
from pipelines.friction.config import FRICTION
from pipelines.friction.laws import gravity_acts, gravity_columns
from pipelines.io.log import ExperimentLog

__all__ = ["Course", "Mask", "Stretch", "Sway", "blocks_of_time", "moved", "stretches_of"]
__all__ += ["sway_columns", "swaying"]

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]

KINKED = 2  # numerics: order of a smoother for motion whose acceleration jumps


@dataclass(frozen=True, eq=False)
class Sway:
    """A joint that is held and sways while another one is driven."""

    lean: Array  # δ [rad] (samples,) from where it is held
    speed: Array  # [rad/s] (samples,)
    nearer: bool  # the base than the driven joint


def sway_columns(t: Array, q: Array, dq: Array, sways: Sequence[Sway], revolute: bool) -> Array:
    """Return what swaying joints do to the driven one, to first order in their sway δ.

    A controller lets a held joint k lean by milliradians when joint j is driven. Row j of the arm's
    equations then has, with q that of joint j and every number free,

        (d0 + d1 sin q + d2 cos q) ddδ    D_jk with k nearer the base; beyond j it is d0 ddδ
        (g1 sin q + g2 cos q) δ           weight that leans with k
        m d/dt (δ dq)                     D_jj depends on the joints beyond j alone

    Small as they are, they come with every torque of the driven joint: left out, they pass for
    inertia. A prismatic joint has q itself in D_jk, and a weight that does not depend on q.

    Args:
        t, q, dq: (samples,) time, position and speed of the driven joint.

    Returns:
        Means over the step after each sample (samples, columns); the last row is zero.
    """
    rate = 1.0 / np.diff(t)
    middle = 0.5 * (q[1:] + q[:-1])
    turn = [np.sin(middle), np.cos(middle)]
    columns: list[Array] = []
    for sway in sways:
        push, lean = np.diff(sway.speed) * rate, 0.5 * (sway.lean[1:] + sway.lean[:-1])
        columns.append(push)
        if sway.nearer:
            columns += [push * part for part in (turn if revolute else [middle])]
        else:
            columns.append(np.diff(sway.lean * dq) * rate)
        columns += [lean * part for part in turn] if revolute else [lean]
    return np.vstack([*columns, np.zeros((0, len(rate)))]).T


@dataclass(frozen=True, eq=False)
class Course:
    """Friction that changes in each log by α c(t) f(v), f its curve.

    c = (exp(-h/T) - exp(-t/T)) / (1 - exp(-D/T)) rises by one over the duration D of a log.
    """

    time: float  # T [s]
    holds: float  # h [s] since the start of a log, where c is zero
    until: float  # D [s]
    time_std: float | None = None  # [s] of T
    curve: tuple[Array, Array] | None = None  # speeds [rad/s] and torques [N m] of f

    def at(self, since: Array) -> Array:
        """Return c(t) at times since the start of a log [s]."""
        rise = np.exp(-self.holds / self.time) - np.exp(-since / self.time)
        return np.asarray(rise / -np.expm1(-self.until / self.time))

    def column(self, t: Array, dq: Array) -> Array:
        """Return c(t) f(v) over the step after each sample (samples - 1, 1)."""
        assert self.curve is not None
        shape = np.interp(0.5 * (dq[1:] + dq[:-1]), *self.curve)
        return (self.at(0.5 * (t[1:] + t[:-1]) - t[0]) * shape)[:, None]


@dataclass(frozen=True, eq=False)
class Windows:
    """Nodes, and the windows over which columns are averaged."""

    nodes: Motion  # (nodes, 1)
    share: Array  # (nodes,) time of a node over the length of its window
    first: Indices  # (windows,) first node of every window
    kept: Mask  # (windows,) whether it makes a row

    def means(self, columns: Array) -> Array:
        """Return the mean of columns (nodes, k) in every row (rows, k)."""
        sums = np.add.reduceat(columns * self.share[:, None], self.first, axis=0)
        return np.asarray(sums[self.kept])

    def thinned(self, every: int) -> Windows:
        """Return every `every`-th row, with its own nodes alone."""
        if every == 1:
            return self
        chosen = np.flatnonzero(self.kept)[::every]
        count = np.diff(np.append(self.first, len(self.share)))[chosen]
        begin = np.concatenate([[0], np.cumsum(count)[:-1]])
        index = np.repeat(self.first[chosen] - begin, count) + np.arange(count.sum())
        of = self.nodes
        nodes = Motion(of.t[index], of.q[index], of.dq[index], of.ddq[index])
        return Windows(nodes, self.share[index], begin, np.ones(len(chosen), dtype=bool))


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples of one joint without a gap, and the windows its equations are taken over."""

    name: str  # of the log
    t: Array  # [s] (samples,)
    measured: Array  # [rad] (samples,) position by the encoder, NaN where it is missing
    tau: Array  # [N m] (samples,) held until the next
    q: Array  # [rad] (samples,) reconstructed
    dq: Array  # [rad/s] (samples,)
    spoilt: Mask  # (samples,) no row may use it
    window: int  # samples
    revolute: bool
    sways: tuple[Sway, ...] = ()
    speed_std: float = 0.0  # [rad/s] of the reconstructed speed
    weighs: bool = True  # gravity acts about the joint's axis
    untimed: bool = False  # the torque is measured: when in its step it acted is not known
    sticks: Mask | None = None  # (windows,) the joint does not slide: no row of a sliding law
    course: Course | None = None  # of friction that changes in time

    def only(self, rows: Mask) -> Stretch:
        """Return it with some of its usable rows (usable rows,), whichever it has now."""
        sticks = np.zeros(len(self.usable), dtype=bool)
        sticks[self.usable] = ~rows
        return replace(self, sticks=sticks if sticks.any() else None)

    @property
    def rows(self) -> int:
        return int(self.kept.sum())

    @cached_property
    def edges(self) -> Indices:
        """Return the samples at which windows begin and end."""
        return np.arange(0, len(self.t), self.window)

    @cached_property
    def usable(self) -> Mask:
        """Return whether nothing in a window is spoilt (windows,)."""
        bad = np.concatenate([[0], np.cumsum(self.spoilt)])
        return np.asarray(bad[self.edges[1:] + 1] == bad[self.edges[:-1]])

    @property
    def kept(self) -> Mask:
        """Return the windows that are usable, and not left out as sticking (windows,)."""
        return self.usable if self.sticks is None else self.usable & ~self.sticks

    @property
    def known_tau(self) -> Array:
        """Return the torque (samples,) [N m], zero where it is missing."""
        return np.where(np.isfinite(self.tau), self.tau, 0.0)

    @cached_property
    def impulse(self) -> Array:
        """Return ∫ τ dt from the first sample (samples,) [N m s]."""
        return np.concatenate([[0.0], np.cumsum(self.known_tau[:-1] * np.diff(self.t))])

    @cached_property
    def length(self) -> Array:
        """Return the length of the windows (windows,) [s]."""
        return np.diff(self.t[self.edges])

    @cached_property
    def mean_torque(self) -> Array:
        """Return the mean torque of every window (windows,) [N m]."""
        return np.asarray(np.diff(self.impulse[self.edges]) / self.length)

    @property
    def largest(self) -> float:
        """Return the largest torque on the joint, rests and reversals included [N m]."""
        return float(np.abs(self.mean_torque).max())

    @cached_property
    def torque(self) -> Array:
        """Return the mean torque of every window that is kept (rows,) [N m]."""
        return self.mean_torque[self.kept]

    @cached_property
    def rigid(self) -> Array:
        """Return the columns of J, of gravity, and of `more` (rows, width)."""
        mean = np.diff(self.dq[self.edges]) / self.length
        gravity = gravity_columns(self.nodes.q[:, 0], self.revolute) * float(self.weighs)
        more = np.diff(self.pushed[self.edges], axis=0) / self.length[:, None]
        if self.untimed:
            more[:, 0] = self._timing
        return np.hstack([mean[self.kept, None], self.windows.means(gravity), more[self.kept]])

    @property
    def _timing(self) -> Array:
        """Return the mean change of torque in a step (windows,).

        It is taken from the samples next to each window: their noise is not in its own mean.
        """
        known, edges = self.known_tau, self.edges
        before = np.maximum(edges[:-1] - 1, 0)
        before = np.where(np.isfinite(self.tau[before]), before, edges[:-1])
        return np.asarray((known[edges[1:]] - known[before]) / (edges[1:] - before))

    @cached_property
    def _laid(self) -> tuple[Motion, Array, Indices]:
        return _nodes(self.t, self.q, self.dq)

    @property
    def nodes(self) -> Motion:
        """Return where the integrals are summed."""
        return self._laid[0]

    @cached_property
    def windows(self) -> Windows:
        """Return where the nodes lie in the windows that are kept."""
        nodes, ends, sample = self._laid
        first = np.searchsorted(sample, self.edges)
        length = np.full(len(sample), np.inf)
        length[: first[-1]] = np.repeat(self.length, np.diff(first))
        return Windows(nodes, np.diff(ends) / length, first[:-1], self.kept)

    def sampler(self, every: int, pointwise: bool) -> tuple[Motion, Callable[[Array], Array]]:
        """Return nodes, and the means in every `every`-th row of columns over these nodes."""
        if pointwise:
            few = self.windows.thinned(every)
            return few.nodes, few.means
        return self.nodes, lambda columns: self.windows.means(columns)[::every]

    @cached_property
    def more(self) -> Array:
        """Return more columns over the step after each sample (samples - 1, columns).

        Of a torque sample that may act a part of a step later or earlier, its change over the step;
        of joints that are held and sway; and of friction that changes.
        """
        parts = [sway_columns(self.t, self.q, self.dq, self.sways, self.revolute)]
        if self.untimed:
            parts.insert(0, np.diff(self.known_tau)[:, None])
        if self.course is not None:
            parts.append(self.course.column(self.t, self.dq))
        return np.hstack(parts)

    @cached_property
    def pushed(self) -> Array:
        """Return ∫ more dt from the first sample on (samples, columns)."""
        steps = self.more * np.diff(self.t)[:, None]
        return np.vstack([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])

    def accumulated(self, values: Array) -> Array:
        """Return ∫ values dt of values (nodes,) from the first sample on (samples,)."""
        ends = self._laid[1]
        whole = np.concatenate([[0.0], np.cumsum(values * np.diff(ends))])
        return np.asarray(np.interp(self.t, ends, whole))

    @cached_property
    def middle(self) -> tuple[Array, Array]:
        """Return mean speed, and mean time since the start, of every row (rows,)."""
        of = self.nodes
        dq, t = self.windows.means(np.hstack([of.dq, of.t[:, None]])).T
        return dq, t - self.t[0]


def _nodes(t: Array, q: Array, dq: Array) -> tuple[Motion, Array, Indices]:
    """Place nodes along a motion whose speed runs straight from sample to sample.

    Returns:
        The nodes, the times between them (nodes + 1,) [s], and the sample before each (nodes,).
    """
    change, middle, length = np.diff(dq), 0.5 * (dq[1:] + dq[:-1]), np.diff(t)
    jump = np.abs(change)
    turning = np.abs(middle) < (FRICTION.near + 0.5) * jump
    turning &= jump > FRICTION.little * float(np.abs(dq).max())
    count = np.where(turning, FRICTION.parts, 1)
    at = np.repeat(np.arange(len(count)), count)
    first = (np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count)) / count[at]
    place = first + 0.5 / count[at]
    v, position = dq[at] + place * change[at], q[at] + place * np.diff(q)[at]
    nodes = np.stack([position, v, (change / length)[at]])[..., None]
    return (
        Motion(t[at] + place * length[at], *nodes),
        np.append(t[at] + first * length[at], t[-1]),
        at,
    )


def blocks_of_time(stretches: Sequence[Stretch], length: float) -> Indices:
    """Return the number, from 0, of the block of `length` [s] that each row is in (rows,)."""
    codes = [10**7 * k + np.floor(one.middle[1] / length) for k, one in enumerate(stretches)]
    return np.asarray(np.unique(np.concatenate(codes), return_inverse=True)[1], dtype=np.intp)


def _travels(motion: Reconstructed) -> Mask:
    """Return whether a joint travels further than rounding moves one that is held (joints,)."""
    q = motion.motion.q[motion.good.kept[motion.good.fit]]
    return np.asarray(np.ptp(q, axis=0) > FRICTION.sway * encoder_resolution(motion.good))


def swaying(motion: Reconstructed, joint: int) -> tuple[int, ...]:
    """Return the joints, counted from 1, that are held but visibly sway with `joint`."""
    return tuple(int(k) + 1 for k in np.flatnonzero(_travels(motion)) if k != joint - 1)


def moved(motions: Sequence[Reconstructed]) -> Mask:
    """Return whether any log moves a joint beyond encoder steps and noise (joints,)."""
    moves = []
    for one in motions:
        far, rows = _travels(one), one.good.kept[one.good.fit]
        if one.std is not None:
            speed = np.sqrt(np.nanmean(np.square(one.motion.dq[rows]), axis=0))
            far &= speed > FRICTION.fast * np.nanmedian(one.std[1][rows], axis=0)
        moves.append(far)
    return np.asarray(np.any(moves, axis=0))


def stretches_of(
    log: ExperimentLog, joint: int, found: Reconstructed, window: float, swaying: Sequence[int] = ()
) -> tuple[Stretch, ...]:
    """Return what of `log` is usable for joint `joint`, in windows of `window` [s].

    Args:
        joint: counted from 1.
        found: the motion of `log`.
        swaying: joints that are held and sway.
    """
    good, j, stretches = found.good, joint - 1, []
    others = np.delete(np.nanmedian(good.log.q, axis=0), j).tolist()
    weighs = gravity_acts(log.robot, joint, others)
    size = max(FRICTION.shortest, round(window / log.sample_time))
    for run in good.runs:
        rows = good.kept[run]
        q, dq = found.motion.q[rows, j], found.motion.dq[rows, j]
        spoilt = (good.missing | good.spikes | good.saturated)[run, j] | ~np.isfinite(q + dq)
        doubt = 0.0
        if found.std is not None:
            speed = found.std[1][rows, j]
            spoilt |= speed > FRICTION.vague * np.nanmedian(found.std[1][:, j])
            doubt = float(np.nanmedian(speed))
        stretch = Stretch(
            log.name,
            good.log.t[run],
            np.where(good.position_spikes[run, j], np.nan, good.log.q[run, j]),
            good.log.tau[run, j],
            np.where(np.isfinite(q), q, 0.0),
            np.where(np.isfinite(dq), dq, 0.0),
            spoilt,
            size,
            log.robot.joints[j].revolute,
            tuple(_sway(found, run, k - 1, log.sample_time, k < joint) for k in swaying),
            doubt,
            weighs,
            log.torque == "measured",
        )
        if len(stretch.edges) > FRICTION.fewest and stretch.rows >= FRICTION.fewest:
            stretches.append(stretch)
    return tuple(stretches)


def _sway(found: Reconstructed, run: slice, k: int, step: float, nearer: bool) -> Sway:
    """Return the sway of joint `k`, counted from 0.

    Torque of the driven joint comes in steps, so that the speed of the other has kinks.
    """
    good = found.good
    lean = np.where(good.position_spikes[run, k], np.nan, good.log.q[run, k])
    rest = np.nanmedian(good.log.q[:, k])
    lean = (lean - rest)[:, None]
    try:
        tuned, _ = tune(lean, step, encoder_resolution(good)[[k]], KINKED)
    except InputRejected:
        rows = good.kept[run]
        return Sway(found.motion.q[rows, k] - rest, found.motion.dq[rows, k], nearer)
    states = smooth(lean, design(step, tuned.jerk_std, tuned.noise_variance, KINKED)).states
    return Sway(states[0, :, 0], states[1, :, 0], nearer)
