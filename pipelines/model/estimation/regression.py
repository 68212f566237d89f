"""The equations a fit takes from a log: τ = Y β, everything in them averaged, filtered and thinned out alike.

    model = nominal_columns(body, laws)                 which columns: rigid body, friction laws at every joint
    for block in LogEquations(model, motion, ...):      iterate as often as needed; memory constant in the samples;
                                                        the covariance of a motion that repeats holds a period

Kostić et al. 2004, eq. (12)-(14). A held command acts from its sample to the next, so that beside states at t_k it comes
half a sample late: ½ (τ_k + τ_{k-1}) is centred, and the same average is taken of every column. The low-pass is
zero-phase, and the same over torque and columns: what it takes from one it takes from the other (Gautier 1997).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.rrr import ACTING, RRR
from pipelines.effects.base import ArmModel, Effect
from pipelines.estimation.filters import centre_hold, centre_samples, zero_phase
from pipelines.estimation.motion import Reconstructed
from pipelines.fit.contrasts import of_mean
from pipelines.fit.equations import Block
from pipelines.model.estimation.conditioning import Conditioning
from pipelines.model.estimation.peaks import bridged, near_peaks

__all__ = ["Column", "Columns", "LogEquations", "Rows"]

# time, and of each joint: columns, torque, and which of its equations count (None: all)
_Piece = tuple[Array, tuple[Array, ...], tuple[Array, ...], tuple[npt.NDArray[np.bool_], ...] | None]

_SEED = 20040509
_BLOCK = 32768  # samples of the log worked on at once
_SETTLE = 10.0  # periods of the cut-off after which a fourth-order low-pass has forgotten to 1e-10
_TOUCHED = 1.0  # periods of the cut-off to either side over which one bad sample spreads
_LOST = 3.0  # times the usual standard deviation of a position, beyond which it is not known
_MEMORY = 0.05  # [s] of the smoother, where no low-pass has a longer one


@dataclass(frozen=True)
class Column:
    """One parameter of the equations."""

    name: str  # "p3", or by place and name: "viscous:2:coefficient"
    unit: str


@dataclass(frozen=True, eq=False)
class Columns:
    """Which columns the equations have: the rigid body's, or some of them, and every law's amplitudes."""

    body: RigidBody
    kept: tuple[int, ...]  # of the body's parameters
    laws: tuple[Effect, ...]
    arm: ArmModel  # what the laws may ask

    @cached_property
    def names(self) -> tuple[Column, ...]:
        rigid = [Column(self.body.parameters[i].name, self.body.parameters[i].unit) for i in self.kept]
        turning = self.body.robot.revolute
        more = [Column(f"{law.name}:{law.joint}:{q.name}" if law.joint else f"{law.name}:{q.name}",
                       q.unit_at(law.joint is None or turning[law.joint - 1]))
                for law in self.laws for q in law.parameters if not q.shape]
        return (*rigid, *more)

    @property
    def rigid(self) -> range:
        """Places of the rigid columns among all."""
        return range(len(self.kept))

    def rows(self, motion: Motion) -> tuple[tuple[Array, ...], tuple[npt.NDArray[np.intp], ...]]:
        """Of each joint: the columns that act on it (columns, samples), and which of all columns they are."""
        values, places = self._rigid_rows(motion)
        first = len(self.kept)
        added: list[list[Array]] = [[] for _ in values]
        where: list[list[int]] = [[] for _ in values]
        for law in self.laws:
            table = law.columns(motion, self.arm)
            joints = range(table.shape[1]) if law.joint is None else (law.joint - 1,)
            for j in joints:
                added[j] += list(table[:, j].T)
                where[j] += range(first, first + table.shape[2])
            first += table.shape[2]
        return (tuple(np.vstack([v, *a]) if a else v for v, a in zip(values, added, strict=True)),
                tuple(np.append(p, np.array(w, dtype=np.intp)) for p, w in zip(places, where, strict=True)))

    @cached_property
    def _acting(self) -> npt.NDArray[np.bool_]:
        """(joints, parameters) which columns of the body act on a joint at all: what is zero at random states is zero."""
        states = np.random.default_rng(_SEED).uniform(-3.0, 3.0, (3, 16, self.body.robot.n_joints))
        return np.asarray(self.body.regressor(*states).any(axis=0))

    def _rigid_rows(self, motion: Motion) -> tuple[list[Array], list[npt.NDArray[np.intp]]]:
        if isinstance(self.body, RRR):
            rows = self.body.acting_rows(motion.q, motion.dq, motion.ddq, np.empty((28, len(motion.t))))
            acting = [np.array(columns, dtype=np.intp) for columns in ACTING]
        else:
            table = self.body.regressor(motion.q, motion.dq, motion.ddq).transpose(1, 2, 0)
            acting = [np.flatnonzero(row) for row in self._acting]
            rows = tuple(table[j, index] for j, index in enumerate(acting))
        place = np.full(len(self.body.parameters), -1, dtype=np.intp)
        place[list(self.kept)] = np.arange(len(self.kept))
        keep = [place[index] >= 0 for index in acting]
        return ([row[k] for row, k in zip(rows, keep, strict=True)],
                [place[index[k]] for index, k in zip(acting, keep, strict=True)])


@dataclass(frozen=True, eq=False)
class Rows:
    """Which samples of the mended log make equations."""

    out: npt.NDArray[np.bool_]  # (samples,) none: spoilt, vague, or so near to it that the low-pass spreads it here
    slow: npt.NDArray[np.bool_]  # (samples, joints) none of this joint: too slow, or too near to torque that it may not have got

    def __and__(self, other: Rows) -> Rows:
        """Samples that make equations in both."""
        return Rows(self.out | other.out, self.slow | other.slow)


@dataclass(frozen=True, eq=False)
class LogEquations:
    """The equations of one log. Iterable as often as needed."""

    columns: Columns
    found: Reconstructed
    conditioning: Conditioning
    held: bool  # the torque is a held command: centre it
    known: Callable[[Motion], Array] | None = None  # torque (samples, joints) [N m] that is subtracted: of a given friction
    chosen: Rows | None = None  # instead of the log's own choice: the same for several ways to reconstruct

    def __iter__(self) -> Iterator[Block]:
        for run in self.runs:
            yield from self._of_run(run)

    @cached_property
    def runs(self) -> tuple[slice, ...]:
        """Stretches without a gap that outlast the low-pass."""
        shortest = 8 if self.conditioning.low_pass is None else 2 * self.conditioning.low_pass.padding
        return tuple(run for run in self.found.good.runs if run.stop - run.start > shortest)

    @cached_property
    def rows(self) -> Rows:
        """The samples that make equations."""
        if self.chosen is not None:
            return self.chosen
        good = self.found.good
        spoilt = (good.missing | good.spikes | good.saturated) | self._unknown
        touched = np.asarray(spoilt.any(axis=1))
        out, cutoff = np.ones(len(touched), dtype=bool), self.conditioning.cutoff_hz
        reach = 2 if cutoff is None else int(np.ceil(_TOUCHED / (cutoff * good.log.sample_time)))
        for run in self.runs:
            count = np.cumsum(np.concatenate([np.zeros(reach + 1), touched[run], np.zeros(reach)]))
            out[run] = count[2 * reach + 1:] > count[:-2 * reach - 1]
        if (mean := self.found.mean) is not None:  # the rest are copies
            out[:mean.first] = out[mean.last:] = True
        slow = np.abs(self.found.motion.dq[good.kept]) < np.array(self.conditioning.min_speed)
        slow = slow if self.found.stuck is None else slow | self.found.stuck
        return Rows(out, slow | near_peaks(good, self.runs, self.conditioning.low_pass, ~(out[:, None] | slow)))

    @cached_property
    def counts(self) -> npt.NDArray[np.intp]:
        """(joints,) about how many equations there are of each joint, before any is made."""
        every, found = self.conditioning.decimation, np.zeros(self.rows.slow.shape[1], dtype=np.intp)
        for run in self.runs:
            thin = slice(run.start, run.stop, every)
            found += np.sum(~self.rows.out[thin, None] & ~self.rows.slow[thin], axis=0)
        return found

    @property
    def counted(self) -> tuple[slice, ...]:
        """The runs without what is a copy of a mean period."""
        if (mean := self.found.mean) is None:
            return self.runs
        return tuple(slice(max(run.start, mean.first), min(run.stop, mean.last)) for run in self.runs)

    @property
    def repeats(self) -> float:
        """Periods of which an equation is the mean, on average; scaled by its root, all have noise of one strength."""
        return 1 if self.found.mean is None else self.found.mean.periods

    @property
    def samples(self) -> int:
        """Moments that make equations of any joint."""
        return sum(len(self._moments(run)) for run in self.runs)

    @property
    def guard(self) -> int:
        """Equations apart, from which on two share no noise: a low-pass spreads a sample's to both sides."""
        how, step = self.conditioning, self.found.good.log.sample_time
        reach = _MEMORY if how.cutoff_hz is None else 2.0 * _TOUCHED / how.cutoff_hz
        return int(np.ceil(reach / (step * how.decimation)))

    def times(self) -> Array:
        """The time of every equation [s]."""
        return np.asarray(self.found.motion.t[self._rows_of_motion])

    def postures(self) -> Array:
        """(samples, joints) the position at every equation [rad or m]."""
        return np.asarray(self.found.motion.q[self._rows_of_motion])

    @property
    def _rows_of_motion(self) -> npt.NDArray[np.intp]:
        return np.asarray(self.found.good.kept[np.concatenate([self._moments(run) for run in self.runs])])

    def _moments(self, run: slice) -> npt.NDArray[np.intp]:
        """Samples of the mended log that make equations of any joint."""
        end = int(self.held)
        moments = np.arange(run.start, run.stop)[end:run.stop - run.start - end][-end % self.conditioning.decimation::
                                                                                 self.conditioning.decimation]
        return np.asarray(moments[~self.rows.out[moments]])

    def _of_run(self, run: slice) -> Iterator[Block]:
        for _, values, y, used in self._pieces(run):
            if len(y[0]):
                noise = 0 if self.found.mean is None else of_mean(self.repeats)
                yield Block(len(self.columns.names), self._places, values, y, used, noise)

    @cached_property
    def _places(self) -> tuple[npt.NDArray[np.intp], ...]:
        return self.columns.rows(_part(self.found, slice(self.runs[0].start, self.runs[0].start + 8)))[1]

    def _pieces(self, run: slice) -> Iterator[_Piece]:
        """Each stretch of a run, conditioned and thinned out."""
        how, rate = self.conditioning, 1.0 / self.found.good.log.sample_time
        margin = 2 if how.cutoff_hz is None else int(np.ceil(_SETTLE * rate / how.cutoff_hz))
        inner = _BLOCK - _BLOCK % how.decimation
        length = run.stop - run.start
        for first in range(0, length, inner):
            last = min(first + inner, length)
            if length - last < margin:  # a short rest joins the stretch before it
                last = length
            wide = slice(run.start + max(0, first - margin), run.start + min(length, last + margin))
            yield self._conditioned(wide, run.start + first, run.start + last, -first % how.decimation)
            if last == length:
                return

    def _conditioned(self, wide: slice, first: int, last: int, phase: int) -> _Piece:
        how = self.conditioning
        motion, tau = self.stretch(wide)
        rows, _ = self.columns.rows(motion)
        known = None if self.known is None else self.known(motion)
        begin = 0
        if self.held:  # the first and the last sample have no neighbour to be averaged with
            rows, tau, begin = tuple(centre_samples(row.T).T for row in rows), centre_hold(tau), 1
            known = None if known is None else centre_samples(known)
        if known is not None:
            tau = tau - known
        stacks = [np.vstack([row, u]).T for row, u in zip(rows, tau.T, strict=True)]
        if how.low_pass is not None:
            stacks = [zero_phase(s, how.low_pass) for s in stacks]
        inside = np.arange(wide.start + begin, wide.start + begin + len(stacks[0]))
        chosen = np.flatnonzero((inside >= first + phase) & (inside < last) & ((inside - first - phase) % how.decimation == 0))
        keep = chosen[~self.rows.out[wide][chosen + begin]]
        slow = self.rows.slow[wide][keep + begin]
        scale = np.sqrt(self.repeats)
        parts = [np.where(slow[:, j, None], 0.0, s[keep] if scale == 1.0 else scale * s[keep]) for j, s in enumerate(stacks)]
        return (motion.t[keep + begin], tuple(np.ascontiguousarray(p[:, :-1].T) for p in parts),
                tuple(np.ascontiguousarray(p[:, -1]) for p in parts), tuple(~slow.T) if slow.any() else None)

    @cached_property
    def _unknown(self) -> npt.NDArray[np.bool_]:
        """(samples, joints) of the mended log: no motion, or a vague one."""
        kept, motion = self.found.good.kept, self.found.motion
        return np.asarray(~np.isfinite(motion.q + motion.dq + motion.ddq)[kept] | self.found.vague[kept])

    @cached_property
    def _lost(self) -> npt.NDArray[np.bool_]:
        """(samples, joints) of the mended log where the position is not known either."""
        found, kept = self.found, self.found.good.kept
        lost = ~np.isfinite(found.motion.q)[kept]
        if found.std is None:
            return np.ones_like(lost)
        std = found.std[0][kept]
        known = [column[~np.isnan(column)] for column in std.T]
        usual = np.array([np.median(x) if x.size else np.nan for x in known])
        return np.asarray(lost | ~(std <= _LOST * usual))

    def stretch(self, wide: slice) -> tuple[Motion, Array]:
        """Motion and torque with what is spoilt bridged by straight lines."""
        good, motion = self.found.good, _part(self.found, wide)
        tau = good.log.tau[wide]
        spoilt = (good.missing | good.spikes | good.saturated)[wide]
        unknown = self._unknown[wide]
        if not (spoilt | unknown).any():
            return motion, tau
        # Where the acceleration is vague the position need not be: friction with a memory starts from where the joint was.
        q = bridged(motion.q, unknown & self._lost[wide])
        dq, ddq = (bridged(x, unknown) for x in (motion.dq, motion.ddq))
        return Motion(motion.t, q, dq, ddq), bridged(tau, spoilt)


def _part(found: Reconstructed, stretch: slice) -> Motion:
    """The motion at the samples of a stretch of the mended log."""
    rows, motion = found.good.kept[stretch], found.motion
    return replace(motion, t=motion.t[rows], q=motion.q[rows], dq=motion.dq[rows], ddq=motion.ddq[rows])
