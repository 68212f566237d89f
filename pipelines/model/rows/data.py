"""Lay logs out as rows: every torque over a motion is averaged, filtered and thinned out alike.

    data = gather(motions, columns, recipe)
    data.y                              (rows,) measured torque of every log and joint
    data.lay(lambda motion: torque)     (rows,) any torque, or (rows, k) of k columns, in the same rows
    data.whitened(Whitening.of(data, residuals))        the same rows, their noise white

The rows of a log are those of its first joint in order of time, then those of its second; the logs
follow each other. The filters are linear, and act on torque and columns alike, in the frequency
domain: for a held command the average over two samples (`signal.filters.centre_samples`), the
zero-phase low-pass |H|², and nothing beyond half the rate of the thinned rows. Rows next to the end
of a stretch, where the low-pass has to guess what was before, are left out.

A drive's zero wanders slowly, and a low-pass makes neighbouring rows alike: noise has a colour. With
the best prediction a of a row's noise by the p rows before it (`signal.prediction`), every signal x
becomes x_i - Σ_k a_k x_{i-k}, and least squares of that are generalised ones (Aitken 1935).
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
    ample,
    passed_both_ways,
    prediction_errors,
    prediction_weights,
    thinned,
)
from pipelines.estimation.motion import Motions
from pipelines.estimation.regression import Columns, LogEquations, Rows
from pipelines.io.log import Array, ExperimentLog

__all__ = ["END", "PAD", "Data", "Kept", "LogData", "Run", "Whitening", "gather", "run_of"]

Indices = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

PAD = 4.0  # periods of the cut-off by which a stretch is continued
END = 2.0  # periods of the cut-off left out at either end of a stretch: so far the low-pass carries what was before it
_AT_ONCE = 8  # numerics: channels, which stay near the processor
_ORDER = 20  # rows: as far as the noise of the low-pass reaches, and a fifth of a second
_RIDGE = 1e-4  # of the noise's power: what the low-pass keeps back is not brought back by more
_ROOM = 64 << 20  # [bytes]


class Kept:
    """The rows asked for last; the oldest make room. What comes out is not to be written to."""

    def __init__(self) -> None:
        self._used = 0
        self._rows: OrderedDict[Hashable, npt.NDArray[Any]] = OrderedDict()

    def of(self, key: Hashable, lay: Callable[[], npt.NDArray[Any]]) -> npt.NDArray[Any]:
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
    """Of each joint."""

    weights: Array  # (joints, order + 1, order + 1) of a row and of those before it, predicted by no row, by one, …

    @classmethod
    def of(cls, data: Data, residuals: Array) -> Whitening:
        """From `residuals` (m, rows) [N m], by the mean autocovariance over the stretches of each joint."""
        products = np.zeros((data.n_joints, _ORDER + 1))
        rows = np.zeros(data.n_joints)
        first = 0
        for one in data.logs:
            for joint in range(one.n_joints):
                for stretch in one.stretches[joint]:
                    if not one.weighed[joint, stretch.start]:
                        continue
                    x = residuals[:, first + stretch.start:first + stretch.stop]
                    rows[joint] += x.size
                    for lag in range(min(_ORDER + 1, x.shape[1])):
                        products[joint, lag] += np.sum(x[:, lag:] * x[:, :x.shape[1] - lag])
                first += one.rows
        means = products / np.maximum(rows, 1.0)[:, None]
        return cls(np.array([prediction_weights(own, _RIDGE) for own in means]))

    def through(self, x: Array, joints: Sequence[int] | npt.NDArray[np.intp], stretches: Sequence[Sequence[slice]]) -> Array:
        """(channels, rows) of `x`, each channel a torque of one of the `joints` (channels,); every one of the `stretches` of its
        joint for itself."""
        out = np.empty_like(x)
        which = np.asarray(joints)
        for joint in np.unique(which):
            own = np.flatnonzero(which == joint)
            for stretch in stretches[joint]:
                out[own, stretch] = prediction_errors(self.weights[joint], x[own, stretch])
        return out


@dataclass(frozen=True, eq=False)
class Run:
    """A stretch without a gap: what is done to a signal of it, in the frequency domain."""

    held: bool  # the torque is a held command: columns are averaged as it is
    response: Array  # (bins,) low-pass, at the frequencies of the padded stretch, as far as the thinned rows go
    average: Array  # (bins,) of the average over two samples of a smooth signal
    size: int  # of the padded stretch
    pad: int  # of samples, a whole number of steps
    every: Fraction  # samples between thinned rows
    chosen: Indices  # places in the thinned stretch that become rows

    @cached_property
    def samples(self) -> Indices:
        """(rows,) the sample nearest to each."""
        return np.asarray(np.rint(self.chosen * float(self.every)), dtype=np.intp)

    def between(self, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(samples, …) -> (rows, …) unfiltered."""
        if self.every.denominator == 1:
            return np.asarray(x[self.samples])
        at = self.chosen * float(self.every)
        before = at.astype(np.intp)
        after, share = np.minimum(before + 1, len(x) - 1), (at - before).reshape(-1, *[1] * (x.ndim - 1))
        return np.asarray((1.0 - share) * x[before] + share * x[after])

    def lay(self, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """A smooth signal (channels, samples) -> (channels, rows)."""
        return self._through(x, self.response * self.average if self.held else self.response)

    def lay_command(self, tau: Array) -> Array:
        """The same of the torque (joints, samples): of a held command ½ (u_k + u_{k-1}) is its average."""
        if self.held:
            tau = 0.5 * (tau + np.concatenate([tau[:, :1], tau[:, :-1]], axis=1))
        return self._through(tau, self.response)

    def _through(self, x: npt.NDArray[Any], response: Array) -> npt.NDArray[Any]:
        pad, end, out = self.pad, x.shape[1] + self.pad, np.empty((len(x), len(self.chosen)), x.dtype)
        wide, places = np.zeros((min(len(x), _AT_ONCE), self.size), x.dtype), self.chosen + int(pad / self.every)
        for first in range(0, len(x), _AT_ONCE):
            some = x[first:first + _AT_ONCE]
            table = wide[:len(some)]
            table[:, pad:end] = some
            np.subtract(2.0 * some[:, :1], some[:, pad:0:-1], out=table[:, :pad])
            np.subtract(2.0 * some[:, -1:], some[:, -2:-pad - 2:-1], out=table[:, end:end + pad])
            out[first:first + _AT_ONCE] = thinned(table, response, int(self.size / self.every))[:, places]
        return out


def run_of(equations: LogEquations, part: slice, skip: int = 1) -> Run:
    how, held = equations.conditioning, equations.held
    rate, step = 1.0 / equations.found.good.log.sample_time, how.step
    n, whole = part.stop - part.start, step.numerator
    cutoff = how.cutoff_hz
    reach = min(2 if cutoff is None else int(np.ceil(END * rate / cutoff)), n // 4)
    pad = whole * (min(n - 2, 16 if cutoff is None else int(np.ceil(PAD * rate / cutoff))) // whole)
    from scipy.fft import next_fast_len

    size = 2 * whole * int(next_fast_len(-(-(n + 2 * pad) // (2 * whole)), real=True))
    bins = np.arange(int(size / step) // 2 + 1)
    turn = 2.0 * np.pi * bins / size
    response = np.ones(len(bins)) if cutoff is None else passed_both_ways(bins * rate / size, cutoff, rate)
    average = (114.0 + 68.0 * np.cos(turn) - 2.0 * np.cos(2.0 * turn)) / 180.0
    run = Run(held, response, average, size // skip, pad // skip, step / skip, np.arange(ceil(reach / step), (n - reach) // step))
    return replace(run, chosen=run.chosen[~equations.rows.out[part][run.samples * skip]])


@dataclass(frozen=True, eq=False)
class LogData:
    """One log: its motion at full rate, and how a signal over it becomes rows."""

    log: ExperimentLog
    equations: LogEquations
    motion: Motion  # at the kept samples of all runs, of a high rate at every nth
    y: Array  # [N m] (joints, rows) measured torque
    weighed: Mask  # (joints, rows) which rows count: those of a joint that is not too slow
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
        """Of each joint."""
        return sum(len(run.chosen) for run in self.runs)

    @cached_property
    def t(self) -> Array:
        """(rows,) [s] of each joint's rows."""
        return np.asarray(self.at_rows(self.motion.t), dtype=np.float64)

    @cached_property
    def stretches(self) -> tuple[tuple[slice, ...], ...]:
        """Of each joint's rows, those that follow each other without a gap, and that all count or all do not."""
        gaps = [np.flatnonzero(np.diff(run.chosen) != 1) + 1 for run in self.runs]
        first = np.cumsum([0, *(len(run.chosen) for run in self.runs)])
        ends = np.concatenate([first, *(start + own for start, own in zip(first, gaps, strict=False))])
        turns = [np.flatnonzero(np.diff(own.astype(np.int8))) + 1 for own in self.weighed]
        return tuple(tuple(slice(a, b) for a, b in pairwise(np.union1d(ends, own).astype(int).tolist())) for own in turns)

    def whitened(self, whitening: Whitening, kept: Kept) -> LogData:
        """The same with rows through `whitening`."""
        return replace(self, y=whitening.through(self.y, range(self.n_joints), self.stretches), whitening=whitening, kept=kept,
                       unwhitened=self.y)

    def coarse(self, kept: Kept) -> LogData:
        """Return the same rows of a motion at fewer samples; columns of causes are met to a fifteenth, that of a gap is not."""
        own, fewer = _skipped(self.equations), _skipped(self.equations, COARSE)
        by = fewer // own if fewer % own == 0 else 1
        if by == 1:
            return self
        some = [np.arange(piece.start, piece.stop, by) for piece in self.pieces]
        at, ends = np.concatenate(some), np.cumsum([0, *map(len, some)]).tolist()
        m, pieces = self.motion, tuple(slice(a, b) for a, b in pairwise(ends))
        runs = tuple(run_of(self.equations, run, own * by) for run in self.equations.runs)
        t, q, dq, ddq = (x[at] for x in (m.t, m.q, m.dq, m.ddq))
        for x in (t, q, dq, ddq):
            x.flags.writeable = False
        tau = None if m.tau is None else m.tau[at]
        motion = Motion(t, q, dq, ddq, tau, m.logged, since=-(-m.since // by), log_sample_time=m.log_sample_time)
        return replace(self, motion=motion, pieces=pieces, runs=runs, kept=kept)

    def at_rows(self, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return `x` (samples, …) at the times of the rows, unfiltered and interpolated linearly."""
        return np.concatenate([run.between(x[piece]) for piece, run in self._parts])

    def lay(self, table: Array) -> Array:
        """Columns over the motion, (samples, joints) or (samples, joints, k), as (joints, rows) or (k, joints, rows)."""
        flat = table.reshape(len(table), -1).T
        active = np.flatnonzero(flat.any(axis=1))
        out = np.zeros((len(flat), self.rows))
        if len(active):
            out[active] = self.lay_signals(flat[active], active // (1 if table.ndim == 2 else table.shape[2]))
        laid: Array = out if table.ndim == 2 else out.reshape(*table.shape[1:], self.rows).transpose(1, 0, 2)
        if not self.weighed.all():
            laid[..., ~self.weighed] = 0.0
        return laid

    def lay_signals(self, x: npt.NDArray[Any], joints: Sequence[int] | Indices) -> npt.NDArray[Any]:
        """(channels, samples) of torques of the `joints` (channels,), from 0 -> (channels, rows)."""
        rows = np.concatenate([run.lay(np.ascontiguousarray(x[:, piece])) for piece, run in self._parts], axis=1)
        return rows if self.whitening is None else self.whitening.through(rows, joints, self.stretches)

    @property
    def _parts(self) -> list[tuple[slice, Run]]:
        return list(zip(self.pieces, self.runs, strict=True))


@dataclass(frozen=True, eq=False)
class Data:
    """Rows of several logs. A row that does not count is zero in everything."""

    logs: tuple[LogData, ...]
    first: int = 0  # number of the first log among all that are diagnosed: of what happens in one log only
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
        return np.concatenate([np.full(one.n_joints * one.rows, k) for k, one in enumerate(self.logs)])

    @cached_property
    def t(self) -> Array:
        """(rows,) [s] within each log."""
        return np.concatenate([np.tile(one.t, one.n_joints) for one in self.logs])

    @cached_property
    def coarse(self) -> Data:
        """The same rows with columns from fewer samples: exact enough for a search, and not for a fit."""
        kept = Kept()
        logs = tuple(one.coarse(kept) for one in self.logs)
        same = all(a is b for a, b in zip(logs, self.logs, strict=True))
        return self if same else replace(self, logs=logs)

    @cached_property
    def counts(self) -> Mask:
        return np.concatenate([one.weighed.ravel() for one in self.logs])

    @cached_property
    def y(self) -> Array:
        measured = np.concatenate([one.y.ravel() for one in self.logs])
        return self.clear(measured if self.known is None else measured - self.known)

    def largest_torque(self, joint: int | None) -> float:
        """[N m] the largest that the logs show of the joints that turn, or slide, as `joint`, from 1, does; of all for None."""
        revolute = np.array(self.logs[0].log.robot.revolute)
        alike = np.full(len(revolute), True) if joint is None else revolute == revolute[joint - 1]
        return float(max(np.abs(one.plain * one.weighed)[alike].max(initial=0.0) for one in self.logs))

    @property
    def rows(self) -> int:
        return len(self.joint)

    def whitened(self, whitening: Whitening) -> Data:
        """Return the same rows through `whitening`."""
        kept = Kept()
        known = None if self.known is None else self.through(whitening, self.known)
        return replace(self, logs=tuple(one.whitened(whitening, kept) for one in self.logs), known=known)

    def through(self, whitening: Whitening, x: Array) -> Array:
        """What `x` (…, rows) is in whitened rows."""
        flat, first, out = x.reshape(-1, x.shape[-1]), 0, []
        for one in self.logs:
            for joint in range(one.n_joints):
                own = flat[:, first:first + one.rows]
                out.append(whitening.through(own, np.full(len(own), joint, dtype=np.intp), one.stretches))
                first += one.rows
        return np.concatenate(out, axis=1).reshape(x.shape)

    def lay(self, torque: Callable[[Motion], Array]) -> Array:
        """`torque` of the motion of each log, (samples, joints) or (samples, joints, k), as (rows,) or (k, rows)."""
        return self.lay_each(lambda _, motion: torque(motion))

    def lay_each(self, torque: Callable[[int, Motion], Array]) -> Array:
        """The same of a torque that may differ from log to log: of each log's number and motion."""
        laid = [one.lay(torque(self.first + k, one.motion)) for k, one in enumerate(self.logs)]
        return np.concatenate([x.reshape(*x.shape[:-2], -1) for x in laid], axis=-1)

    def lay_kept(self, key: Hashable, torque: Callable[[Motion], Array], times: Array | None = None) -> Array:
        """As `lay` of columns (samples, joints, k) that follow from the motion alone; `key` says which they are.

        Args:
            times: (k,) numbers of the columns, for the torque (rows,) that they give; None: the columns themselves.
        """
        def lay(one: LogData) -> Callable[[], Array]:
            return lambda: np.ascontiguousarray(one.lay(torque(one.motion)))  # to be seen as (k, rows) without a copy

        each = (one.kept.of((one.place, key), lay(one)) for one in self.logs)
        laid = (x.reshape(len(x), -1) for x in each)
        return np.concatenate([x if times is None else times @ x for x in laid], axis=-1)

    def blocks(self, count: int) -> Indices:
        """(rows,) to which of about `count` stretches of time a row belongs, each within one log, all joints alike."""
        total = sum(one.rows for one in self.logs)
        out, first = [], 0
        for one in self.logs:
            own = max(1, round(count * one.rows / total))
            out.append(np.tile(first + np.arange(one.rows) * own // max(one.rows, 1), one.n_joints))
            first += own
        return np.concatenate(out)

    def moved(self, x: Array, by: int) -> Array:
        """Return `x` (rows,) of the row that is `by` rows earlier in the same log and joint, 0 where there is none."""
        place = self.log_of * self.n_joints + self.joint
        before = np.roll(np.arange(len(x)), by)
        return np.where((place == place[before]) & (np.arange(len(x)) - before == by), x[before], 0.0)

    def split(self, x: Array) -> Iterator[Array]:
        """(rows,) -> (joints, rows) of each log."""
        first = 0
        for one in self.logs:
            size = one.n_joints * one.rows
            yield x[first:first + size].reshape(one.n_joints, one.rows)
            first += size

    def rms(self, x: Array) -> Array:
        """(joints,) root mean square of `x` (rows,) over the rows that count."""
        power, count = self.power(x)
        return np.asarray(np.sqrt(power / np.maximum(count, 1)))

    def power(self, x: Array) -> tuple[Array, Indices]:
        """(joints,) sum of squares of `x` (rows,) over the rows that count, and how many these are."""
        square = np.bincount(self.joint, np.where(self.counts, x, 0.0) ** 2, minlength=self.n_joints)
        return np.asarray(square, dtype=np.float64), np.bincount(self.joint[self.counts], minlength=self.n_joints)

    def clear(self, x: npt.NDArray[Any], rows: Indices | None = None) -> npt.NDArray[Any]:
        """Return `x` (…, rows), zero in rows that do not count; `rows`: which these are, of some of the joints all."""
        counts = self.counts if rows is None else self.counts[rows]
        return x if counts.all() else np.where(counts, x, 0.0)


def gather(motions: Motions, columns: Columns, recipe: Recipe, rows: Sequence[Rows] | None = None, first: int = 0) -> Data:
    """The rows of the logs; `recipe` with its cut-off.

    Args:
        rows: of each log which samples may be rows; its own choice where left out.
        first: number of the first log.

    Raises:
        InputRejected: T04, every stretch of a log is too short for the low-pass, or spoilt.
    """
    logs, kept = zip(motions, equations_of(motions, recipe, columns, rows), strict=True), Kept()
    return Data(tuple(_of_log(log, equations, kept, k) for k, ((log, _), equations) in enumerate(logs)), first)


def _of_log(log: ExperimentLog, equations: LogEquations, kept: Kept, place: int) -> LogData:
    stretches = [equations.stretch(run) for run in equations.runs]
    fine = [run_of(equations, run) for run in equations.runs]
    y = np.concatenate([run.lay_command(tau.T) for run, (_, tau) in zip(fine, stretches, strict=True)], axis=1)
    skip = _skipped(equations)
    some = [(Motion(m.t[::skip], m.q[::skip], m.dq[::skip], m.ddq[::skip]), tau[::skip]) for m, tau in stretches]
    tau = np.concatenate([tau for _, tau in some])
    t, q, dq, ddq = (np.concatenate([getattr(m, name) for m, _ in some]) for name in ("t", "q", "dq", "ddq"))
    for x in (t, q, dq, ddq):  # what is kept with the motion depends on them
        x.flags.writeable = False
    ends = np.cumsum([0, *(len(tau) for _, tau in some)]).tolist()
    pieces = tuple(slice(a, b) for a, b in pairwise(ends))
    runs = tuple(run_of(equations, run, skip) for run in equations.runs)
    slow = np.concatenate([equations.rows.slow[run][one.samples] for run, one in zip(equations.runs, fine, strict=True)])
    asked = tau if equations.held else None  # a measured torque was there: nothing of it can have been kept back
    since = _first_known(runs[0], pieces[0])
    logged = None if equations.held else tau[since]
    motion = Motion(t, q, dq, ddq, asked, logged, since=since, log_sample_time=log.sample_time)
    return LogData(log, equations, motion, y, ~slow.T, pieces, runs, kept, place)


def _first_known(run: Run, piece: slice) -> int:
    """The sample from which on the motion is good, by a period of the low-pass before the first row."""
    if not len(run.chosen):
        return 0
    first = int(run.samples[0])
    return int(max(0, min(first - run.pad // int(PAD), piece.stop - 1)))


def _skipped(equations: LogEquations, per_period: float = AMPLE) -> int:
    """Return every how many samples columns are computed, at least so many times in a period of the low-pass."""
    how = equations.conditioning
    if how.cutoff_hz is None or how.step.denominator > 1:
        return 1
    step = equations.found.good.log.sample_time
    highest = min(how.cutoff_hz, 0.5 / (step * how.step))  # rows further apart than the low-pass asks for show less
    return max(k for k in range(1, ample(highest, 1.0 / step, per_period) + 1) if how.step.numerator % k == 0)
