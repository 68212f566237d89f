"""Lay logs out as rows: every torque over a motion is averaged, filtered and thinned out alike.

    data = gather(motions, columns, recipe)
    data.y                              (rows,) measured torque of every log and joint
    data.lay(lambda motion: torque)     (rows,) any torque, or (rows, k) of k columns, in these rows
    data.whitened(Whitening.of(data, residuals))        the same rows, their noise white

The rows of a log are those of its first joint in order of time, then those of its second; the logs
follow each other. The filters are linear, and act on torque and columns alike, in the frequency
domain: for a held command the average over two samples (`filters.centre_samples`), the zero-phase
low-pass |H|², and nothing beyond half the rate of the thinned rows. Rows next to the end of a
stretch, where the low-pass has to guess what was before, are left out.

A drive's zero wanders slowly, and a low-pass makes neighbouring rows alike: noise has a colour.
With the best prediction a of a row's noise by the p rows before it (`filters.prediction_weights`),
every signal x becomes x_i - Σ_k a_k x_{i-k}, and least squares of that are generalised ones (Aitken
1935).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Motion
from pipelines.estimation.estimate import Recipe, equations_of
from pipelines.estimation.filters import (
    AMPLE,
    COARSE,
    PAD,
    ample,
    fast_length,
    passed_both_ways,
    prediction_errors,
    prediction_weights,
    thinned,
)
from pipelines.estimation.least_squares import Flags, Indices
from pipelines.estimation.motion import Motions
from pipelines.estimation.regression import Columns, LogEquations, Rows
from pipelines.io.log import Array, ExperimentLog

Signals = npt.NDArray[Any]

END = 2.0  # numerics: periods of the cut-off left out at either end: so far the low-pass reaches
_AT_ONCE = 8  # numerics: channels, which stay near the processor
_ORDER = 20  # numerics: rows that predict one: as far as the noise of the low-pass reaches
_RIDGE = 1e-4  # numerics: of the noise's power: what the low-pass keeps back is not amplified more
_ROOM = 64 << 20  # numerics: [bytes]


class Kept:
    """The rows that were laid last; the oldest make room. The arrays are read-only."""

    def __init__(self) -> None:
        self._used = 0
        self._rows: OrderedDict[Hashable, Signals] = OrderedDict()

    def of(self, key: Hashable, lay: Callable[[], Signals]) -> Signals:
        """Return what `lay` makes, or made before under the same key."""
        found = self._rows.pop(key, None)
        if found is None:
            found = lay()
            found.flags.writeable = False
            self._used += found.nbytes
        self._rows[key] = found
        while self._used > _ROOM and len(self._rows) > 1:
            _, old = self._rows.popitem(last=False)
            self._used -= old.nbytes
        return found


@dataclass(frozen=True, eq=False)
class Whitening:
    """Weights of each joint's rows that make their noise white."""

    weights: Array  # (joints, order + 1, order + 1) of a row and of those before it

    @classmethod
    def of(cls, data: Data, residuals: Array) -> Whitening:
        """Return that of `residuals` (m, rows) [N m], by the mean autocovariance of each joint."""
        products = np.zeros((data.n_joints, _ORDER + 1))
        rows = np.zeros(data.n_joints)
        first = 0
        for one in data.logs:
            for joint in range(one.n_joints):
                for stretch in one.stretches[joint]:
                    if not one.weighed[joint, stretch.start]:
                        continue
                    x = residuals[:, first + stretch.start : first + stretch.stop]
                    rows[joint] += x.size
                    for lag in range(min(_ORDER + 1, x.shape[1])):
                        products[joint, lag] += np.sum(x[:, lag:] * x[:, : x.shape[1] - lag])
                first += one.rows
        means = products / np.maximum(rows, 1.0)[:, None]
        return cls(np.array([prediction_weights(own, _RIDGE) for own in means]))

    def through(
        self, x: Array, joints: Sequence[int] | Indices, stretches: Sequence[Sequence[slice]]
    ) -> Array:
        """Return (channels, rows) of `x`, each channel a torque of one of the `joints`."""
        out, which = np.empty_like(x), np.asarray(joints)
        for joint in np.unique(which):
            own = np.flatnonzero(which == joint)
            for stretch in stretches[joint]:
                out[own, stretch] = prediction_errors(self.weights[joint], x[own, stretch])
        return out


@dataclass(frozen=True, eq=False)
class Run:
    """A stretch without a gap: what is done to a signal of it, in the frequency domain."""

    held: bool  # the torque is a held command: columns are averaged as it is
    response: Array  # (bins,) low-pass, at the frequencies of the padded stretch
    average: Array  # (bins,) of the average over two samples of a smooth signal
    size: int  # of the padded stretch
    pad: int  # of samples, a whole number of steps
    every: Fraction  # samples between thinned rows
    chosen: Indices  # places in the thinned stretch that become rows

    @cached_property
    def samples(self) -> Indices:
        """(rows,) the sample nearest to each."""
        return np.asarray(np.rint(self.chosen * float(self.every)), dtype=np.intp)

    def between(self, x: Signals) -> Signals:
        """Return (samples, …) at the rows (rows, …), unfiltered."""
        if self.every.denominator == 1:
            return np.asarray(x[self.samples])
        at = self.chosen * float(self.every)
        before = at.astype(np.intp)
        after = np.minimum(before + 1, len(x) - 1)
        share = (at - before).reshape(-1, *[1] * (x.ndim - 1))
        return np.asarray((1.0 - share) * x[before] + share * x[after])

    def lay(self, x: Signals) -> Signals:
        """Return a smooth signal (channels, samples) as rows (channels, rows)."""
        return self._through(x, self.response * self.average if self.held else self.response)

    def lay_command(self, tau: Array) -> Array:
        """Return the torque (joints, samples): of a held command ½ (u_k + u_{k-1}) is averaged."""
        if self.held:
            tau = 0.5 * (tau + np.concatenate([tau[:, :1], tau[:, :-1]], axis=1))
        return self._through(tau, self.response)

    def _through(self, x: Signals, response: Array) -> Signals:
        pad, end = self.pad, x.shape[1] + self.pad
        out = np.empty((len(x), len(self.chosen)), x.dtype)
        wide = np.zeros((min(len(x), _AT_ONCE), self.size), x.dtype)
        count, places = int(self.size / self.every), self.chosen + int(pad / self.every)
        for first in range(0, len(x), _AT_ONCE):
            some = x[first : first + _AT_ONCE]
            table = wide[: len(some)]
            table[:, pad:end] = some
            np.subtract(2.0 * some[:, :1], some[:, pad:0:-1], out=table[:, :pad])
            behind = table[:, end : end + pad]
            np.subtract(2.0 * some[:, -1:], some[:, -2 : -pad - 2 : -1], out=behind)
            out[first : first + _AT_ONCE] = thinned(table, response, count)[:, places]
        return out


def run_of(equations: LogEquations, part: slice, skip: int = 1) -> Run:
    """Return what is done to signals of a stretch of which every `skip`-th sample is used."""
    how = equations.conditioning
    rate, step, cutoff = 1.0 / equations.found.good.log.sample_time, how.step, how.cutoff_hz
    n, whole = part.stop - part.start, step.numerator
    reach = min(2 if cutoff is None else int(np.ceil(END * rate / cutoff)), n // 4)
    pad = min(n - 2, 16 if cutoff is None else int(np.ceil(PAD * rate / cutoff)))
    pad = whole * (pad // whole)
    size = 2 * whole * fast_length(-(-(n + 2 * pad) // (2 * whole)))
    bins = np.arange(int(size / step) // 2 + 1)
    turn = 2.0 * np.pi * bins / size
    response = np.ones(len(bins))
    if cutoff is not None:
        response = passed_both_ways(bins * rate / size, cutoff, rate)
    average = (114.0 + 68.0 * np.cos(turn) - 2.0 * np.cos(2.0 * turn)) / 180.0
    chosen = np.arange(ceil(reach / step), (n - reach) // step)
    run = Run(equations.held, response, average, size // skip, pad // skip, step / skip, chosen)
    return replace(run, chosen=chosen[~equations.rows.out[part][run.samples * skip]])


@dataclass(frozen=True, eq=False)
class LogData:
    """One log: its motion at full rate, and how a signal over it becomes rows."""

    log: ExperimentLog
    equations: LogEquations
    motion: Motion  # at the kept samples of all runs, of a high rate at every nth
    y: Array  # [N m] (joints, rows) measured torque
    weighed: Flags  # (joints, rows) which rows count: those of a joint that is not too slow
    pieces: tuple[slice, ...]  # of each run among those samples
    runs: tuple[Run, ...]
    kept: Kept  # what was laid before, of all logs gathered with it
    place: int  # among them
    whitening: Whitening | None = None  # that rows pass at last; `y` has
    unwhitened: Array | None = None  # `y` before that

    @property
    def n_joints(self) -> int:
        return int(self.motion.q.shape[1])

    @property
    def plain(self) -> Array:
        """[N m] (joints, rows) measured torque that has passed no whitening."""
        return self.y if self.unwhitened is None else self.unwhitened

    @cached_property
    def rows(self) -> int:
        """Rows of each joint."""
        return sum(len(run.chosen) for run in self.runs)

    @cached_property
    def t(self) -> Array:
        """(rows,) [s] of each joint's rows."""
        return np.asarray(self.at_rows(self.motion.t), dtype=np.float64)

    @cached_property
    def stretches(self) -> tuple[tuple[slice, ...], ...]:
        """Of each joint's rows, those without a gap that all count or all do not."""
        gaps = [np.flatnonzero(np.diff(run.chosen) != 1) + 1 for run in self.runs]
        first = np.cumsum([0, *(len(run.chosen) for run in self.runs)])
        inner = (start + own for start, own in zip(first, gaps, strict=False))
        ends = np.concatenate([first, *inner])
        found = []
        for own in self.weighed:
            turns = np.flatnonzero(np.diff(own.astype(np.int8))) + 1
            edges = np.union1d(ends, turns).astype(int).tolist()
            found.append(tuple(slice(a, b) for a, b in pairwise(edges)))
        return tuple(found)

    def whitened(self, whitening: Whitening, kept: Kept) -> LogData:
        """Return the same with rows through `whitening`."""
        y = whitening.through(self.y, range(self.n_joints), self.stretches)
        return replace(self, y=y, whitening=whitening, kept=kept, unwhitened=self.y)

    def coarse(self, kept: Kept) -> LogData:
        """Return the same rows of a motion at fewer samples: exact to a fifteenth of a column."""
        own, fewer = _skipped(self.equations), _skipped(self.equations, COARSE)
        by = fewer // own if fewer % own == 0 else 1
        if by == 1:
            return self
        some = [np.arange(piece.start, piece.stop, by) for piece in self.pieces]
        at, ends = np.concatenate(some), np.cumsum([0, *map(len, some)]).tolist()
        m, pieces = self.motion, tuple(slice(a, b) for a, b in pairwise(ends))
        runs = tuple(run_of(self.equations, run, own * by) for run in self.equations.runs)
        t, q, dq, ddq = (_frozen(x[at]) for x in (m.t, m.q, m.dq, m.ddq))
        tau, since = None if m.tau is None else m.tau[at], -(-m.since // by)
        step = m.log_sample_time
        motion = Motion(t, q, dq, ddq, tau, m.logged, since=since, log_sample_time=step)
        return replace(self, motion=motion, pieces=pieces, runs=runs, kept=kept)

    def at_rows(self, x: Signals) -> Signals:
        """Return `x` (samples, …) at the times of the rows, interpolated linearly."""
        parts = zip(self.pieces, self.runs, strict=True)
        return np.concatenate([run.between(x[piece]) for piece, run in parts])

    def lay(self, table: Array) -> Array:
        """Return columns (samples, joints) or (samples, joints, k) as (joints, rows) or (k, …)."""
        flat = table.reshape(len(table), -1).T
        active = np.flatnonzero(flat.any(axis=1))
        out = np.zeros((len(flat), self.rows))
        if len(active):
            joints = active // (1 if table.ndim == 2 else table.shape[2])
            out[active] = self.lay_signals(flat[active], joints)
        laid: Array = out
        if table.ndim > 2:
            laid = out.reshape(*table.shape[1:], self.rows).transpose(1, 0, 2)
        if not self.weighed.all():
            laid[..., ~self.weighed] = 0.0
        return laid

    def lay_signals(self, x: Signals, joints: Sequence[int] | Indices) -> Signals:
        """Return torques (channels, samples) of the `joints` (channels,) as (channels, rows)."""
        parts = zip(self.pieces, self.runs, strict=True)
        laid = [run.lay(np.ascontiguousarray(x[:, piece])) for piece, run in parts]
        rows = np.concatenate(laid, axis=1)
        if self.whitening is None:
            return rows
        return self.whitening.through(rows, joints, self.stretches)


@dataclass(frozen=True, eq=False)
class Data:
    """Rows of several logs. A row that does not count is zero in everything."""

    logs: tuple[LogData, ...]
    first: int = 0  # number of the first log among all: of what happens in one log only
    known: Array | None = None  # (rows,) [N m] torque that is subtracted: of standing effects

    @property
    def n_joints(self) -> int:
        return self.logs[0].n_joints

    @cached_property
    def joint(self) -> Indices:
        """(rows,) joint of each row, from 0."""
        return np.concatenate([np.repeat(np.arange(one.n_joints), one.rows) for one in self.logs])

    @cached_property
    def log_of(self) -> Indices:
        """(rows,) log of each row."""
        sizes = enumerate(one.n_joints * one.rows for one in self.logs)
        return np.concatenate([np.full(size, k) for k, size in sizes])

    @cached_property
    def t(self) -> Array:
        """(rows,) [s] within each log."""
        return np.concatenate([np.tile(one.t, one.n_joints) for one in self.logs])

    @cached_property
    def coarse(self) -> Data:
        """The same rows with columns from fewer samples: for a search, and not for a fit."""
        kept = Kept()
        logs = tuple(one.coarse(kept) for one in self.logs)
        same = all(a is b for a, b in zip(logs, self.logs, strict=True))
        return self if same else replace(self, logs=logs)

    @cached_property
    def counts(self) -> Flags:
        """(rows,) which of them count."""
        return np.concatenate([one.weighed.ravel() for one in self.logs])

    @cached_property
    def y(self) -> Array:
        """(rows,) [N m] measured torque, less what is known."""
        measured = np.concatenate([one.y.ravel() for one in self.logs])
        return self.clear(measured if self.known is None else measured - self.known)

    def largest_torque(self, joint: int | None) -> float:
        """Return the largest torque [N m] of the joints that turn, or slide, as `joint`, from 1."""
        revolute = np.array(self.logs[0].log.robot.revolute)
        alike = np.full(len(revolute), True)
        if joint is not None:
            alike = revolute == revolute[joint - 1]
        parts = (np.abs(one.plain * one.weighed)[alike].max(initial=0.0) for one in self.logs)
        return float(max(parts))

    @property
    def rows(self) -> int:
        return len(self.joint)

    def whitened(self, whitening: Whitening) -> Data:
        """Return the same rows through `whitening`."""
        kept = Kept()
        known = None if self.known is None else self.through(whitening, self.known)
        logs = tuple(one.whitened(whitening, kept) for one in self.logs)
        return replace(self, logs=logs, known=known)

    def through(self, whitening: Whitening, x: Array) -> Array:
        """Return `x` (…, rows) in whitened rows."""
        flat, first, out = x.reshape(-1, x.shape[-1]), 0, []
        for one in self.logs:
            for joint in range(one.n_joints):
                own = flat[:, first : first + one.rows]
                joints = np.full(len(own), joint, dtype=np.intp)
                out.append(whitening.through(own, joints, one.stretches))
                first += one.rows
        return np.concatenate(out, axis=1).reshape(x.shape)

    def lay(self, torque: Callable[[Motion], Array]) -> Array:
        """Return `torque` of each motion, (samples, joints[, k]), as (rows,) or (k, rows)."""
        return self.lay_each(lambda _, motion: torque(motion))

    def lay_each(self, torque: Callable[[int, Motion], Array]) -> Array:
        """Return a torque that may differ from log to log: of each log's number and motion."""
        each = enumerate(self.logs, self.first)
        laid = [one.lay(torque(k, one.motion)) for k, one in each]
        return np.concatenate([x.reshape(*x.shape[:-2], -1) for x in laid], axis=-1)

    def lay_kept(
        self, key: Hashable, torque: Callable[[Motion], Array], times: Array | None = None
    ) -> Array:
        """Lay columns (samples, joints, k) that follow from the motion alone; `key` names them.

        Args:
            times: (k,) numbers of the columns, for their torque (rows,); None: the columns.
        """
        parts = []
        for one in self.logs:

            def lay(one: LogData = one) -> Array:
                return np.ascontiguousarray(one.lay(torque(one.motion)))

            x = one.kept.of((one.place, key), lay)
            x = x.reshape(len(x), -1)  # without a copy
            parts.append(x if times is None else times @ x)
        return np.concatenate(parts, axis=-1)

    def blocks(self, count: int) -> Indices:
        """(rows,) to which of about `count` stretches of time a row belongs, joints alike."""
        total, out, first = sum(one.rows for one in self.logs), [], 0
        for one in self.logs:
            own = max(1, round(count * one.rows / total))
            place = np.arange(one.rows) * own // max(one.rows, 1)
            out.append(np.tile(first + place, one.n_joints))
            first += own
        return np.concatenate(out)

    def moved(self, x: Array, by: int) -> Array:
        """Return `x` (rows,) of the row `by` rows earlier in the same log and joint, or 0."""
        place, rows = self.log_of * self.n_joints + self.joint, np.arange(len(x))
        before = np.roll(rows, by)
        return np.where((place == place[before]) & (rows - before == by), x[before], 0.0)

    def split(self, x: Array) -> Iterator[Array]:
        """Yield (joints, rows) of each log from (rows,)."""
        first = 0
        for one in self.logs:
            size = one.n_joints * one.rows
            yield x[first : first + size].reshape(one.n_joints, one.rows)
            first += size

    def rms(self, x: Array) -> Array:
        """(joints,) root mean square of `x` (rows,) over the rows that count."""
        power, count = self.power(x)
        return np.asarray(np.sqrt(power / np.maximum(count, 1)))

    def power(self, x: Array) -> tuple[Array, Indices]:
        """(joints,) sum of squares of `x` (rows,) over the rows that count, and their number."""
        square, n = np.where(self.counts, x, 0.0) ** 2, self.n_joints
        total = np.asarray(np.bincount(self.joint, square, minlength=n), dtype=np.float64)
        return total, np.bincount(self.joint[self.counts], minlength=n)

    def clear(self, x: Signals, rows: Indices | None = None) -> Signals:
        """Return `x` (…, rows), zero in rows that do not count; `rows`: which these are."""
        counts = self.counts if rows is None else self.counts[rows]
        return x if counts.all() else np.where(counts, x, 0.0)


def gather(
    motions: Motions,
    columns: Columns,
    recipe: Recipe,
    rows: Sequence[Rows] | None = None,
    first: int = 0,
) -> Data:
    """Return the rows of the logs; `recipe` with its cut-off.

    Args:
        rows: of each log which samples may be rows; its own choice where left out.
        first: number of the first log.

    Raises:
        InputRejected: T04, every stretch of a log is too short for the low-pass, or spoilt.
    """
    kept = Kept()
    pairs = zip(motions, equations_of(motions, recipe, columns, rows), strict=True)
    logs = (_of_log(log, own, kept, k) for k, ((log, _), own) in enumerate(pairs))
    return Data(tuple(logs), first)


def _of_log(log: ExperimentLog, equations: LogEquations, kept: Kept, place: int) -> LogData:
    skip, held = _skipped(equations), equations.held
    stretches = [equations.stretch(run) for run in equations.runs]
    fine = [run_of(equations, run) for run in equations.runs]
    laid = [run.lay_command(tau.T) for run, (_, tau) in zip(fine, stretches, strict=True)]
    slow = [equations.rows.slow[run] for run in equations.runs]
    slow = [own[one.samples] for own, one in zip(slow, fine, strict=True)]
    tau = np.concatenate([tau[::skip] for _, tau in stretches])
    # what is kept with the motion depends on them
    t, q, dq, ddq = (
        _frozen(np.concatenate([getattr(m, name)[::skip] for m, _ in stretches]))
        for name in ("t", "q", "dq", "ddq")
    )
    ends = np.cumsum([0, *(len(own[::skip]) for _, own in stretches)]).tolist()
    pieces = tuple(slice(a, b) for a, b in pairwise(ends))
    runs = tuple(run_of(equations, run, skip) for run in equations.runs)
    # the sample from which the motion is good, a period of the low-pass before the first row
    since, first = 0, runs[0]
    if len(first.chosen):
        before = int(first.samples[0]) - first.pad // int(PAD)
        since = int(max(0, min(before, pieces[0].stop - 1)))
    # a measured torque was there: nothing of it can have been kept back
    motion = Motion(
        t,
        q,
        dq,
        ddq,
        tau if held else None,
        None if held else tau[since],
        since=since,
        log_sample_time=log.sample_time,
    )
    y, weighed = np.concatenate(laid, axis=1), ~np.concatenate(slow).T
    return LogData(log, equations, motion, y, weighed, pieces, runs, kept, place)


def _frozen(x: Array) -> Array:
    x.flags.writeable = False
    return x


def _skipped(equations: LogEquations, per_period: float = AMPLE) -> int:
    """Return every how many samples columns are computed, so many a period of the low-pass."""
    how = equations.conditioning
    if how.cutoff_hz is None or how.step.denominator > 1:
        return 1
    step = equations.found.good.log.sample_time
    # rows further apart than the low-pass needs show less
    highest = min(how.cutoff_hz, 0.5 / (step * how.step))
    most = ample(highest, 1.0 / step, per_period)
    return max(k for k in range(1, most + 1) if how.step.numerator % k == 0)
