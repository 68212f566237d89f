"""Make the equations of a log that a fit takes: τ = Y β, averaged, filtered and thinned out alike.

    columns = nominal_columns(robot)                    rigid body, friction laws at every joint
    for block in LogEquations(columns, found, ...):     iterate as often as needed

Kostić et al. 2004, eq. (12)-(14). A held command acts from its sample to the next, so that against
states at t_k it comes half a sample late: ½ (τ_k + τ_{k-1}) is centred, and the same average is
taken of every column. The low-pass is zero-phase, and the same over torque and columns: what it
takes from one it takes from the other (Gautier 1997). Memory is constant in the samples.

A torque beyond the limit of a drive may not have been given. Such samples make no equations, nor do
those next to them. Where a controller winds up, the command is many times the limit, and what is
put in its place differs by so much that the low-pass carries it farther than a bad sample: rows
depend on it where the torque as commanded and the torque bridged differ behind the low-pass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, pairwise
from math import ceil

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.rrr import ACTING, RRR
from pipelines.effects.base import ArmModel, Effect
from pipelines.estimation.config import FitConfig
from pipelines.estimation.filters import (
    KEEP,
    centre_hold,
    centre_samples,
    choose_decimation,
    choose_step,
    zero_phase,
)
from pipelines.estimation.least_squares import Block, Flags, Indices
from pipelines.estimation.motion import Reconstructed
from pipelines.io.limits import GAP_TICKS

_CONFIG = FitConfig()
_SEED = 20040509  # numerics
_BLOCK = 32768  # numerics: samples of the log worked on at once
_SHORTEST = 30  # numerics: samples of a stretch that a low-pass goes over
_SETTLE = 10.0  # numerics: periods of the cut-off after which a low-pass has forgotten to 1e-10


@dataclass(frozen=True)
class Conditioning:
    """The filter and decimation of torque and columns."""

    cutoff_hz: float | None  # None: the rate is too low for one
    decimation: int
    step: Fraction  # samples between rows that are thinned out in the frequency domain
    min_speed: tuple[float, ...]  # [rad/s] slower samples of a joint make no equations of it


def condition(
    motion: Motion,
    rate: float,
    cutoff_hz: float | None,
    decimation: int | None,
    min_speed: Array,
    keep: float = KEEP,
) -> Conditioning:
    """Return the filter for a log, its cut-off from the motion where none is given.

    Args:
        keep: samples left in a period of the cut-off, where no decimation is given.
    """
    cutoff = cutoff_at(wanted_cutoff(motion, rate) if cutoff_hz is None else cutoff_hz, rate)
    every, step = decimation or 1, Fraction(decimation or 1)
    if cutoff is not None and decimation is None:
        every, step = choose_decimation(cutoff, rate, keep), choose_step(cutoff, rate, keep)
    return Conditioning(cutoff, every, step, tuple(map(float, min_speed)))


def cutoff_at(cutoff_hz: float | None, rate: float) -> float | None:
    """Return a cut-off that logs share, for one of `rate`; None where it is above its band."""
    return cutoff_hz if cutoff_hz is not None and cutoff_hz < _CONFIG.highest * rate else None


def wanted_cutoff(motion: Motion, rate: float) -> float:
    """Return the cut-off [Hz] that leaves all that `motion` excites.

    The torque of the rigid body has harmonics of the motion: five times f keeps them, where 99.9 %
    of the power of the speed is below f, and leaves out what only noise and structure fill. Dry
    friction follows the direction of motion alone, and its harmonics end nowhere: of a square wave
    those from the n-th on hold 4 / (π² n) of the power. They tell friction from weight where the
    motion is slow, and are kept as far as arms do not bend.
    """
    known = np.isfinite(motion.dq).all(axis=1)
    t, dq = motion.t[known], motion.dq[known]
    size = dq.std(axis=0)
    dq, size = dq[:, size > 0.0], size[size > 0.0]
    speed = (dq - dq.mean(axis=0)) / size
    rigid = 5.0 * _highest_frequency(t, speed, rate, _CONFIG.speed_share)
    if rigid >= _CONFIG.stiff_hz or not size.size:
        return rigid
    # joints by their speed: the noise of one that is held has no direction
    direction = np.tanh(dq / (_CONFIG.reversal * np.abs(dq).max(axis=0))) * size
    dry = _highest_frequency(t, direction - direction.mean(axis=0), rate, _CONFIG.dry_share)
    return max(rigid, min(dry, _CONFIG.stiff_hz))


def _highest_frequency(t: Array, x: Array, rate: float, share: float) -> float:
    """Return the frequency [Hz] below which `share` of the power of `x` (samples, joints) lies.

    Of stretches without a gap, each by itself: end to end, a jump would count as the fastest
    motion. Short ones, whose own ends are that as well, count only where there are no longer ones;
    where a few samples are lost, a straight line does.
    """
    stretches = []
    cut = 1 + np.flatnonzero(np.diff(t) > GAP_TICKS / rate)
    for own, part in zip(np.split(t, cut), np.split(x, cut), strict=True):
        if len(own) >= 2 and np.diff(own).max() >= 1.5 / rate:
            even = np.arange(own[0], own[-1] + 0.5 / rate, 1.0 / rate)
            part = np.stack([np.interp(even, own, column) for column in part.T], axis=1)
        stretches.append(part)
    longest = max(map(len, stretches))
    power = np.zeros(longest // 2 + 1)
    for part in stretches:
        if len(part) >= _CONFIG.short * longest:
            bins = np.fft.rfft(part * np.hanning(len(part))[:, None], longest, axis=0)
            power += np.sum(np.abs(bins) ** 2, axis=1)
    total = np.cumsum(power)
    if total[-1] <= 0.0:
        return rate
    return float(np.searchsorted(total, share * total[-1]) + 1) * rate / longest


@dataclass(frozen=True)
class Column:
    """One parameter of the equations."""

    name: str  # "p3", or by place and name: "viscous:2:coefficient"
    unit: str


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of equations: the rigid body's, or some of them, and every law's amplitudes."""

    body: RigidBody
    kept: tuple[int, ...]  # of the body's parameters
    laws: tuple[Effect, ...]
    arm: ArmModel  # what the laws depend on

    @cached_property
    def names(self) -> tuple[Column, ...]:
        parameters, turning = self.body.parameters, self.body.robot.revolute
        found = [Column(parameters[i].name, parameters[i].unit) for i in self.kept]
        for law in self.laws:
            place = f"{law.name}:{law.joint}" if law.joint else law.name
            turns = law.joint is None or turning[law.joint - 1]
            amplitudes = (q for q in law.parameters if not q.shape)
            found += [Column(f"{place}:{q.name}", q.unit_at(turns)) for q in amplitudes]
        return tuple(found)

    @property
    def rigid(self) -> range:
        """Places of the rigid columns among all."""
        return range(len(self.kept))

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Places of the amplitudes of each law among all columns."""
        counts = (sum(not q.shape for q in law.parameters) for law in self.laws)
        edges = accumulate(counts, initial=len(self.kept))
        return tuple(slice(*edge) for edge in pairwise(edges))

    def rows(self, motion: Motion) -> tuple[tuple[Array, ...], tuple[Indices, ...]]:
        """Return the columns that act on each joint (columns, samples), and which they are."""
        if isinstance(self.body, RRR):
            room = np.empty((28, len(motion.t)))
            rigid = self.body.acting_rows(motion.q, motion.dq, motion.ddq, room)
        else:
            table = self.body.regressor(motion.q, motion.dq, motion.ddq).transpose(1, 2, 0)
            rigid = tuple(table[j, index] for j, index in enumerate(self._acting))
        place = np.full(len(self.body.parameters), -1, dtype=np.intp)
        place[list(self.kept)] = np.arange(len(self.kept))
        laws = zip(self.laws, self.parts, strict=True)
        added = [(law.joint, law.columns(motion, self.arm), part) for law, part in laws]
        values, places = [], []
        for j, (own, index) in enumerate(zip(rigid, self._acting, strict=True)):
            here = [(table[:, j].T, part) for at, table, part in added if at in (None, j + 1)]
            keep = place[index] >= 0
            values.append(np.vstack([own[keep], *(table for table, _ in here)]))
            numbers = (np.arange(part.start, part.stop) for _, part in here)
            places.append(np.concatenate([place[index[keep]], *numbers]))
        return tuple(values), tuple(places)

    @cached_property
    def _acting(self) -> list[Indices]:
        """Return the columns of the body that act on each joint, found at random states."""
        if isinstance(self.body, RRR):
            return [np.array(columns, dtype=np.intp) for columns in ACTING]
        states = np.random.default_rng(_SEED).uniform(-3.0, 3.0, (3, 16, self.body.robot.n_joints))
        seen = np.asarray(self.body.regressor(*states).any(axis=0))
        return [np.flatnonzero(row) for row in seen]


@dataclass(frozen=True, eq=False)
class Rows:
    """The samples of the repaired log that make equations."""

    out: Flags  # (samples,) none: spoilt, vague, or so near to it that the low-pass spreads it here
    slow: Flags  # (samples, joints) none of this joint: too slow, or near torque that may be cut


@dataclass(frozen=True, eq=False)
class LogEquations:
    """The equations of one log. Iterable as often as needed."""

    columns: Columns
    found: Reconstructed
    conditioning: Conditioning
    held: bool  # the torque is a held command: centre it
    # torque (samples, joints) [N m] that is subtracted: of a given friction
    known: Callable[[Motion], Array] | None = None
    chosen: Rows | None = None  # instead of the log's own choice: the same for several motions

    def __iter__(self) -> Iterator[Block]:
        how = self.conditioning
        margin = 2 if how.cutoff_hz is None else ceil(_SETTLE * self.rate / how.cutoff_hz)
        for run in self.runs:
            edges = [*range(run.start, run.stop, _BLOCK), run.stop]
            if len(edges) > 2 and edges[-1] - edges[-2] < margin:
                del edges[-2]  # a short rest joins the stretch before it
            for first, last in pairwise(edges):
                moments = self._moments(run, first, last)
                if len(moments):
                    wide = slice(max(run.start, first - margin), min(run.stop, last + margin))
                    yield self._block(wide, moments)

    @property
    def rate(self) -> float:
        """[1/s] samples of the log."""
        return 1.0 / self.found.good.log.sample_time

    @cached_property
    def runs(self) -> tuple[slice, ...]:
        """Stretches without a gap that outlast the low-pass."""
        shortest = 8 if self.conditioning.cutoff_hz is None else _SHORTEST
        return tuple(run for run in self.found.good.runs if run.stop - run.start > shortest)

    @cached_property
    def rows(self) -> Rows:
        """The samples that make equations."""
        if self.chosen is not None:
            return self.chosen
        good, how = self.found.good, self.conditioning
        touched = np.asarray((self._spoilt | self._unknown).any(axis=1))
        out, reach = np.ones(len(touched), dtype=bool), 2
        if how.cutoff_hz is not None:
            reach = ceil(_CONFIG.touched * self.rate / how.cutoff_hz)
        for run in self.runs:
            count = np.cumsum(np.pad(touched[run].astype(np.float64), (reach + 1, reach)))
            out[run] = count[2 * reach + 1 :] > count[: -2 * reach - 1]
        if (mean := self.found.mean) is not None:  # the rest are copies
            out[: mean.first] = out[mean.last :] = True
        slow = np.abs(self.found.motion.dq[good.kept]) < np.array(how.min_speed)
        return Rows(out, slow | self._near_peaks(~(out[:, None] | slow)))

    def _near_peaks(self, rows: Flags) -> Flags:
        """Return which samples are too near to torque beyond its limit; none without a low-pass."""
        good, cutoff_hz = self.found.good, self.conditioning.cutoff_hz
        near = np.zeros_like(rows)
        for j in np.flatnonzero(good.saturated.any(axis=0) & (cutoff_hz is not None)):
            beyond, lost = good.saturated[:, j, None], (good.missing | good.spikes)[:, j, None]
            commanded = bridged(good.log.tau[:, j, None], lost)
            least = _CONFIG.matters * float(np.where(beyond, 0.0, np.abs(commanded)).max())
            differ = commanded - bridged(commanded, beyond | lost)
            depends = np.zeros(len(rows), dtype=bool)
            for run in self.runs:
                left = zero_phase(differ[run], cutoff_hz or 0.0, self.rate)
                depends[run] = np.abs(left[:, 0]) > least
            if np.sum(rows[:, j] & ~depends) > _CONFIG.few * np.sum(rows[:, j]):
                near[:, j] = depends
        return near

    @cached_property
    def counts(self) -> Indices:
        """(joints,) equations there are of each joint."""
        return np.asarray(np.sum(~self.rows.slow[self._every], axis=0), dtype=np.intp)

    @property
    def repeats(self) -> float:
        """Periods of which an equation is the mean; by its root all have noise of one strength."""
        return 1 if self.found.mean is None else self.found.mean.periods

    @property
    def guard(self) -> int:
        """Equations apart, from which on two share no noise: what a low-pass spreads."""
        how = self.conditioning
        reach = 2.0 * _CONFIG.touched / how.cutoff_hz if how.cutoff_hz else _CONFIG.memory
        return ceil(reach * self.rate / how.decimation)

    def moments(self) -> Indices:
        """Return the sample of the recording of every equation."""
        return np.asarray(self.found.good.kept[self._every])

    @property
    def _every(self) -> Indices:
        return np.concatenate([self._moments(run, run.start, run.stop) for run in self.runs])

    def _moments(self, run: slice, first: int, last: int) -> Indices:
        """Return the samples first … last - 1 of the repaired log that make equations of any joint.

        Of a held command the first and the last of a run have no neighbour to be averaged with.
        """
        every, end = self.conditioning.decimation, int(self.held)
        moments = np.arange(first + (run.start - first) % every, last, every)
        inside = (moments >= run.start + end) & (moments < run.stop - end)
        return np.asarray(moments[inside & ~self.rows.out[moments]])

    def _block(self, wide: slice, moments: Indices) -> Block:
        """Return the equations of `moments`, conditioned with the samples of `wide` around them."""
        cutoff_hz, begin = self.conditioning.cutoff_hz, int(self.held)
        motion, tau = self.stretch(wide)
        rows, places = self.columns.rows(motion)
        known = None if self.known is None else self.known(motion)
        if self.held:
            rows, tau = tuple(centre_samples(row.T).T for row in rows), centre_hold(tau)
            known = None if known is None else centre_samples(known)
        if known is not None:
            tau = tau - known
        slow, values, y = self.rows.slow[moments], [], []
        for row, torque, still in zip(rows, tau.T, slow.T, strict=True):
            stack = np.vstack([row, torque]).T
            if cutoff_hz is not None:
                stack = zero_phase(stack, cutoff_hz, self.rate)
            own = np.sqrt(self.repeats) * stack[moments - wide.start - begin].T
            own = np.ascontiguousarray(np.where(still, 0.0, own))
            values.append(own[:-1])
            y.append(own[-1])
        used = tuple(~slow.T) if slow.any() else None
        return Block(len(self.columns.names), places, tuple(values), tuple(y), used)

    @cached_property
    def _spoilt(self) -> Flags:
        good = self.found.good
        return np.asarray(good.missing | good.spikes | good.saturated)

    @cached_property
    def _unknown(self) -> Flags:
        """(samples, joints) of the repaired log: no motion, or a vague one."""
        kept, motion = self.found.good.kept, self.found.motion
        finite = np.isfinite(motion.q + motion.dq + motion.ddq)[kept]
        return np.asarray(~finite | self.found.vague[kept])

    def stretch(self, wide: slice) -> tuple[Motion, Array]:
        """Return motion and torque at samples of the repaired log, straight lines over what is bad.

        Where the acceleration is vague the position need not be: friction with a memory starts from
        where the joint was.
        """
        good, m = self.found.good, self.found.motion
        rows, unknown = good.kept[wide], self._unknown[wide]
        q = bridged(m.q[rows], ~np.isfinite(m.q[rows]))
        dq, ddq = (bridged(x[rows], unknown) for x in (m.dq, m.ddq))
        tau = bridged(good.log.tau[wide], self._spoilt[wide])
        return replace(m, t=m.t[rows], q=q, dq=dq, ddq=ddq), tau


def bridged(x: Array, bad: Flags) -> Array:
    """Return `x` (samples, joints) with straight lines where it is bad; 0 of one all bad."""
    if not bad.any():
        return x
    out, place = x.copy(), np.arange(len(x))
    for j in np.flatnonzero(bad.any(axis=0)):
        ill = bad[:, j]
        out[ill, j] = 0.0 if ill.all() else np.interp(place[ill], place[~ill], x[~ill, j])
    return out
