"""Reconstruct position, speed and acceleration from all samples of a log, the later ones too (fixed-interval smoother).

The same model as the observer, Kostić et al. 2004, eq. (18)-(19). Rauch, Tung & Striebel 1965 in the form of Bryson & Frazier
1963, which inverts no covariance: beside the stationary filter x_k, with innovations ν_k, runs backwards

    λ_k = A^T λ_{k+1} + c^T ν_k / S,     x_k^smooth = x_k + P λ_k,     Λ_k likewise for the covariance P - P Λ_k P.

Forward and backward pass, block by block, are one matrix. A start or a gap is again a constant offset δ (observer.py), now
estimated once from all that follows: (I + D Λ_0)^-1 D λ_0. Across a gap later samples speak as information (J, r) about the
predicted state.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.signal import blocks
from pipelines.signal import segments as seg
from pipelines.signal.observer import (
    BLOCK,
    STARTS,
    Observer,
    Start,
    Track,
    advance,
    block_starts,
    checked,
    chunks,
    filter_run,
)
from pipelines.signal.segments import Part, Piece, Prior, Run

__all__ = ["Smoother", "smooth", "twicing_growth"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Kernel:
    """What a block of `size` samples does: beside = [inputs, state at its start, λ after its end]."""

    states: Array  # from beside to the smoothed states (joints, order, size + 2 order, size), in physical time
    adjoint: Array  # from [inputs, state] to the block's part of λ at its start (joints, size + order, order)
    across: Array  # A^size (joints, order, order)


@dataclass(frozen=True)
class _Stretch:
    """A run of measured samples or a gap, and what the forward pass knew before it."""

    first: int
    last: int
    measured: bool
    prior: Prior
    shift: Array  # true minus stationary prediction after its end, (joints, order)


@dataclass(frozen=True)
class _Later:
    """What later samples say: information matrix J and J (x - prediction), (joints, order, order) and (joints, order)."""

    information: Array
    pull: Array


@dataclass(frozen=True)
class Smoother:
    """The smoother that belongs to an observer; it keeps its matrices between logs."""

    observer: Observer

    @cached_property
    def kernels(self) -> dict[int, _Kernel]:
        return {}

    @cached_property
    def parts(self) -> dict[bytes, Smoother]:
        return {}

    @cached_property
    def std(self) -> Array:
        """Standard deviation far from ends and gaps: P - P Λ P. (order, joints)"""
        f = self.observer.filter
        weight = information(self.observer, np.zeros_like(f.prior), f.settled)[:, -1:]
        return seg.deviations(self.observer, f.prior[:, None] - f.prior[:, None] @ weight @ f.prior[:, None])[:, 0]

    def kernel(self, size: int) -> _Kernel:
        if size not in self.kernels:
            self.kernels[size] = _kernel(self.observer, size)
        return self.kernels[size]

    def pick(self, joints: npt.NDArray[np.intp]) -> Smoother:
        return self.parts.setdefault(joints.tobytes(), Smoother(self.observer.pick(joints)))

    @cached_property
    def _starts(self) -> dict[bytes, tuple[Array, Array, Array]]:
        return {}

    def ends(self, excess: Array | None) -> tuple[Array, Array, Array]:
        """`_ends` of a long log from a start of this excess (None: unknown) to an unknown end: no sample decides it, it is kept."""
        key = b"" if excess is None else excess.tobytes()
        if key not in self._starts:
            if len(self._starts) >= STARTS:
                self._starts.clear()
            f = self.observer.filter
            first = seg.diffuse(self.observer) if excess is None else excess
            self._starts[key] = _ends(self.observer, first, np.zeros_like(f.prior), 2 * self.observer.settled)
        return self._starts[key]


def smooth(y: Array, observer: Observer | Smoother, start: Start | None = None, out: Array | None = None) -> Track:
    """Best reconstruction of `y` (samples, joints), NaN where nothing was measured, from all its samples; `out` as in `observe`."""
    own = observer if isinstance(observer, Smoother) else Smoother(observer)
    samples, joints = checked(y, own.observer)
    states = np.empty((joints, own.observer.order, samples)) if out is None else out
    pieces: list[Piece] = []
    for part in seg.parts(y):
        whole = len(part.joints) == joints
        here = own if whole else own.pick(part.joints)
        room = states if whole else np.empty((len(part.joints), own.observer.order, samples))
        pieces += _smooth_part(here, part, seg.begin(here.observer, part, start), room)
        if not whole:
            states[part.joints] = room
    return Track(states.transpose(1, 2, 0), own.std, tuple(pieces))


def twicing_growth(order: int) -> Array:
    """(order,) by what the standard deviation of each state grows where the smoother goes over what it left once more.

    Twicing (Tukey 1977, Exploratory Data Analysis, p. 526) passes 1 - (1 - G)² where one pass gives G: what is left of a
    motion is squared, and so is the bias. A prior of the chain and noise R leave, at frequency w and relative to R,
    G + G² - G³ instead of G. With G = 1 / (1 + x^2n) and the derivative i weighing x^2i these are Beta functions:
    the variance grows by 1 + a (1 - a) / 2 with a = (2 i + 1) / 2 n.
    """
    a = (2.0 * np.arange(order) + 1.0) / (2.0 * order)
    return np.asarray(np.sqrt(1.0 + 0.5 * a * (1.0 - a)))


def _smooth_part(smoother: Smoother, part: Part, prior: Prior, out: Array) -> list[Piece]:
    """Channels that miss the same samples, into `out` (joints, order, samples): forward for the priors, then backward."""
    observer = smoother.observer
    n, joints = observer.order, len(part.joints)
    later = _Later(np.zeros((joints, n, n)), np.zeros((joints, n)))
    pieces: list[Piece] = []
    for stretch in reversed(_forward(observer, part, prior)):
        target = out[:, :, stretch.first:stretch.last]
        if stretch.measured:
            later, stds = _smooth_run(smoother, part.run(stretch.first, stretch.last), stretch, later, target)
        else:
            later, stds = _smooth_gap(observer, stretch, later, target)
            target[:, 0] += part.offset[:, None]
        pieces += [Piece(stretch.first + at, part.joints, std) for at, std in stds]
    return pieces


def _forward(observer: Observer, part: Part, prior: Prior) -> list[_Stretch]:
    """The predictions before every stretch; a long run needs only its blocks, a short one the whole filter."""
    stretches, position, none = [], 0, np.zeros((len(part.joints), observer.order))
    for first, last in [*part.runs, (part.samples, part.samples)]:
        if first > position:
            stretches.append(_Stretch(position, first, False, prior, none))
            prior = seg.predict_gap(observer, prior, first - position).prior
        if last > first:
            before, shift = prior, none
            if last < part.samples:
                y = part.run(first, last)
                after = advance(observer, y, prior.mean)[-1]
                prior = Prior(after, np.zeros_like(observer.filter.prior))
                if last - first < observer.settled:
                    prior = filter_run(observer, y, before, np.empty((len(after), observer.order, last - first)))[1]
                    shift = prior.mean - after
            stretches.append(_Stretch(first, last, True, before, shift))
        position = last
    return stretches


def _smooth_run(smoother: Smoother, y: Run, stretch: _Stretch, later: _Later,
                out: Array) -> tuple[_Later, list[tuple[int, Array]]]:
    """A run of measured samples: stationary smoother, then the offset of its start."""
    observer = smoother.observer
    f, samples, reach = observer.filter, y.samples, observer.settled
    eye = np.eye(observer.order)
    weigh = np.linalg.inv(eye + later.information @ f.prior)
    pull = later.pull + (later.information @ stretch.shift[..., None])[..., 0]
    adjoint = _stationary(smoother, y, stretch.prior.mean, (weigh @ pull[..., None])[..., 0], out)
    open_end = samples >= 2 * reach and not later.information.any()
    excess = seg.diffuse(observer) if stretch.prior.excess is None else stretch.prior.excess
    known, felt, covariance = (smoother.ends(stretch.prior.excess) if open_end else
                               _ends(observer, excess, weigh @ later.information, samples))
    offset = seg.spread(excess, known) @ adjoint[..., None]
    count = felt.shape[1]
    out[:, :, :count] += (felt @ offset[:, None])[..., 0].swapaxes(1, 2) * observer.rate[..., None]
    std = seg.deviations(observer, covariance)
    stds = [(0, std)] if samples <= 2 * reach else [(0, std[:, :reach]), (samples - reach, std[:, reach:])]
    back = np.linalg.inv(eye - known @ f.prior)
    return _Later(back @ known, (back @ adjoint[..., None])[..., 0]), stds


def information(observer: Observer, end: Array, count: int) -> Array:
    """Λ seen from m = 0 .. count samples before an end that knows `end`: Σ_{i<m} (c A^i)^T c A^i / S + A^mT Λ_end A^m."""
    power = blocks.powers(observer.filter.predictor, count)
    row = power[:, :count, 0]
    total = power.swapaxes(2, 3) @ end[:, None] @ power
    total[:, 1:] += np.cumsum(row[..., :, None] * (row * observer.filter.remainder[:, None, None])[..., None, :], axis=1)
    return np.asarray(total)


def _ends(observer: Observer, excess: Array, end: Array, samples: int) -> tuple[Array, Array, Array]:
    """Λ_0; (I - P Λ_k) A^k near the start; smoothed covariances near both ends (of all samples where these meet)."""
    f, reach = observer.filter, observer.settled
    count = min(samples, reach)
    known = information(observer, end, count)
    near = np.arange(samples) if samples <= 2 * reach else np.concatenate([np.arange(reach), np.arange(samples - reach, samples)])
    weight = known[:, np.minimum(samples - near, count)]
    prior = f.prior[:, None]
    felt = (np.eye(f.order) - prior @ weight[:, :count]) @ blocks.powers(f.predictor, count)[:, :count]
    covariance = prior - prior @ weight @ prior
    covariance[:, :count] += felt @ seg.spread(excess, known[:, -1])[:, None] @ felt.swapaxes(2, 3)
    return known[:, -1], felt, covariance


def _smooth_gap(observer: Observer, stretch: _Stretch, later: _Later, out: Array) -> tuple[_Later, list[tuple[int, Array]]]:
    """Missing samples: the prediction from the left and the information from the right, put together."""
    count = stretch.last - stretch.first
    ahead = seg.predict_gap(observer, stretch.prior, count)
    away, noise = seg.gap_covariance(observer, count)
    away, noise = away[:, :0:-1], noise[:, :0:-1]  # from each missing sample to the end of the gap
    eye, j = np.eye(observer.order), later.information[:, None]
    carry = away.swapaxes(2, 3) @ np.linalg.inv(eye + j @ noise)
    known, pull = carry @ j @ away, carry @ later.pull[:, None, :, None]
    spread = np.asarray(np.linalg.solve(eye + ahead.covariance @ known, ahead.covariance), dtype=np.float64)
    out[:] = (ahead.states[..., None] + spread @ pull)[..., 0].swapaxes(1, 2) * observer.rate[..., None]
    return _Later(known[:, 0], pull[:, 0, :, 0]), [(0, seg.deviations(observer, spread))]


def _stationary(smoother: Smoother, y: Run, mean: Array, end: Array, out: Array) -> Array:
    """The stationary smoother of a run from state `mean` to λ `end`, into `out`; returns λ at the start."""
    pieces = chunks(y.samples)
    means = [mean] if len(pieces) == 1 else advance(smoother.observer, y, mean)[:-1]
    for (a, b), before in zip(reversed(pieces), reversed(means), strict=True):
        end = _chunk(smoother, y.take(a, b), before, end, out[:, :, a:b])
        out[:, 0, a:b] += y.offset[:, None]
    return end


def _chunk(smoother: Smoother, y: Array, mean: Array, end: Array, out: Array) -> Array:
    """The same for `y` (joints, samples) at once: blocks forward, blocks backward, and all states in one product."""
    observer, n = smoother.observer, smoother.observer.order
    beside, after = block_starts(observer, y, mean, spare=n)
    count = beside.shape[1]
    rest = y.shape[1] - count * BLOCK
    if rest:
        kernel = smoother.kernel(rest)
        tail = np.concatenate([y[:, -rest:], after, end], axis=1)[:, None]
        out[:, :, -rest:] = (tail[:, None] @ kernel.states)[:, :, 0]
        end = (tail[:, :, :-n] @ kernel.adjoint)[:, 0] + (end[:, None] @ kernel.across)[:, 0]
    if count:
        kernel = smoother.kernel(BLOCK)
        drive = np.empty((len(y), count + 1, n))  # from the last block to the first
        drive[:, 0] = end
        drive[:, 1:] = (beside[:, :, :-n] @ kernel.adjoint)[:, ::-1]
        blocks.scan(kernel.across.swapaxes(1, 2), drive)
        beside[:, :, -n:] = drive[:, -2::-1]
        np.matmul(beside[:, None], kernel.states, out=out[:, :, :count * BLOCK].reshape(*out.shape[:2], count, BLOCK))
        end = drive[:, -1]
    return end


def _kernel(observer: Observer, size: int) -> _Kernel:
    """Predictions forward, innovations, λ backward and x + P λ of a block, folded into one matrix."""
    f = observer.filter
    power = blocks.powers(f.predictor, size)
    free = power[:, :size].transpose(0, 2, 3, 1)  # (joints, state, from state, sample)
    pulse = (power[:, :size - 1] @ (f.transition @ f.gain[..., None])[:, None])[..., 0]
    late = np.concatenate([np.zeros((len(pulse), 1, f.order)), pulse], axis=1).swapaxes(1, 2)
    forward = np.concatenate([blocks.impulse_toeplitz(late), free], axis=2)  # (joints, state, size + order, sample)
    surprise = -forward[:, :1]
    surprise[:, 0, :size] += np.eye(size)
    row = (power[:, :size, 0] * f.remainder[:, None, None]).swapaxes(1, 2)
    backward = blocks.impulse_toeplitz(row).swapaxes(2, 3)  # (joints, λ, innovation, sample)
    spread = np.einsum("nst,ntji->nsji", f.prior, backward)
    end = np.einsum("nst,niut->nsui", f.prior, power[:, size:0:-1])
    states = np.concatenate([forward + surprise @ spread, end], axis=2)
    adjoint = (surprise @ backward[..., :1])[..., 0].transpose(0, 2, 1)
    return _Kernel(states * observer.rate[..., None, None], adjoint, power[:, size])
