"""Reconstruct position, speed and acceleration from all samples of a log (fixed-interval smoother).

The same model as the observer, Kostić et al. 2004, eq. (18)-(19). Rauch, Tung & Striebel 1965 in
the form of Bryson & Frazier 1963, which inverts no covariance: after the stationary filter x_k,
with innovations ν_k, runs backwards

    λ_k = A^T λ_{k+1} + c^T ν_k / S,     x_k^smooth = x_k + P λ_k,     Λ_k for P - P Λ_k P.

Forward and backward pass, block by block, are one matrix. A start or a gap is again a constant
offset δ (`state_estimation`), now estimated once from all that follows: (I + D Λ_0)^-1 D λ_0.
Across a gap later samples speak as information (J, r) about the predicted state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.estimation import chain
from pipelines.estimation.chain import Array
from pipelines.estimation.state_estimation import (
    BLOCK,
    Observer,
    Part,
    Piece,
    Prior,
    Run,
    Start,
    Track,
    advance,
    block_starts,
    by_part,
    chunks,
    filter_run,
    gap_covariance,
    predict_gap,
    spread_of,
)


@dataclass(frozen=True)
class _Kernel:
    """What a block of `size` samples does to [inputs, state at its start, λ after its end]."""

    states: Array  # to the smoothed states (joints, order, size + 2 order, size), physical time
    adjoint: Array  # [inputs, state] to the block's part of λ (joints, size + order, order)
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
    """What later samples say."""

    information: Array  # J (joints, order, order)
    pull: Array  # J (x - prediction) (joints, order)


def smooth(y: Array, observer: Observer, start: Start | None = None) -> Track:
    """Return the best reconstruction of `y` (samples, joints), NaN where missing.

    Raises:
        UsageError, InputRejected: as `observe`.
    """
    return Track(*by_part(y, observer, start, _smooth_part, smoothed_std(observer)))


def smoothed_std(observer: Observer) -> Array:
    """Return the standard deviation far from ends and gaps: P - P Λ P. (order, joints)"""
    f = observer.filter
    weight = information(observer, np.zeros_like(f.prior), f.settled)[:, -1:]
    prior = f.prior[:, None]
    return observer.deviations(prior - prior @ weight @ prior)[:, 0]


def twicing_growth(order: int) -> Array:
    """Return by what the deviation of each state (order,) grows where the smoother goes over what
    it left once more.

    Twicing (Tukey 1977, Exploratory Data Analysis, p. 526) passes 1 - (1 - G)² where one pass gives
    G: what is left of a motion is squared, and so is the bias. A prior of the chain and noise R
    leave, at frequency w and relative to R, G + G² - G³ instead of G. With G = 1 / (1 + x^2n) and
    the derivative i weighing x^2i these are Beta functions: the variance grows by
    1 + a (1 - a) / 2 with a = (2 i + 1) / 2 n.
    """
    a = (2.0 * np.arange(order) + 1.0) / (2.0 * order)
    return np.asarray(np.sqrt(1.0 + 0.5 * a * (1.0 - a)))


def _smooth_part(observer: Observer, part: Part, prior: Prior, out: Array) -> list[Piece]:
    """Smooth channels that miss the same samples: forward for the priors, then backward."""
    n, joints = observer.order, len(part.joints)
    later = _Later(np.zeros((joints, n, n)), np.zeros((joints, n)))
    pieces: list[Piece] = []
    for stretch in reversed(_forward(observer, part, prior)):
        target = out[:, :, stretch.first : stretch.last]
        if stretch.measured:
            run = part.run(stretch.first, stretch.last)
            later, stds = _smooth_run(observer, run, stretch, later, target)
        else:
            later, stds = _smooth_gap(observer, stretch, later, target)
            target[:, 0] += part.offset[:, None]
        pieces += [Piece(stretch.first + at, part.joints, std) for at, std in stds]
    return pieces


def _forward(observer: Observer, part: Part, prior: Prior) -> list[_Stretch]:
    """Return the predictions before every stretch: a long run needs its blocks alone for that."""
    stretches, position, none = [], 0, np.zeros((len(part.joints), observer.order))
    for first, last in [*part.runs, (part.samples, part.samples)]:
        if first > position:
            stretches.append(_Stretch(position, first, False, prior, none))
            prior = predict_gap(observer, prior, first - position).prior
        if last > first:
            before, shift = prior, none
            if last < part.samples:
                y = part.run(first, last)
                after = advance(observer, y, prior.mean)[-1]
                prior = Prior(after, np.zeros_like(observer.filter.prior))
                if last - first < observer.settled:
                    room = np.empty((len(after), observer.order, last - first))
                    prior = filter_run(observer, y, before, room)[1]
                    shift = prior.mean - after
            stretches.append(_Stretch(first, last, True, before, shift))
        position = last
    return stretches


def _smooth_run(
    observer: Observer, y: Run, stretch: _Stretch, later: _Later, out: Array
) -> tuple[_Later, list[tuple[int, Array]]]:
    """Smooth a run of measured samples: stationary, then the offset of its start."""
    f, samples, reach = observer.filter, y.samples, observer.settled
    eye = np.eye(observer.order)
    weigh = np.linalg.inv(eye + later.information @ f.prior)
    pull = later.pull + (later.information @ stretch.shift[..., None])[..., 0]
    end = (weigh @ pull[..., None])[..., 0]
    adjoint = _stationary(observer, y, stretch.prior.mean, end, out)
    excess = observer.excess_of(stretch.prior.excess)
    known, felt, covariance = _ends(observer, excess, weigh @ later.information, samples)
    offset = spread_of(excess, known) @ adjoint[..., None]
    shifted = (felt @ offset[:, None])[..., 0].swapaxes(1, 2)
    out[:, :, : felt.shape[1]] += shifted * observer.rate[..., None]
    std = observer.deviations(covariance)
    stds = [(0, std)] if samples <= 2 * reach else [(0, std[:, :reach])]
    if samples > 2 * reach:
        stds.append((samples - reach, std[:, reach:]))
    back = np.linalg.inv(eye - known @ f.prior)
    return _Later(back @ known, (back @ adjoint[..., None])[..., 0]), stds


def information(observer: Observer, end: Array, count: int) -> Array:
    """Λ seen from m = 0 .. count samples before an end that knows `end`:

    Σ_{i<m} (c A^i)^T c A^i / S + A^mT Λ_end A^m.
    """
    power = chain.powers(observer.filter.predictor, count)
    row = power[:, :count, 0]
    weighed = row * observer.filter.remainder[:, None, None]
    total = power.swapaxes(2, 3) @ end[:, None] @ power
    total[:, 1:] += np.cumsum(row[..., :, None] * weighed[..., None, :], axis=1)
    return np.asarray(total)


def _ends(
    observer: Observer, excess: Array, end: Array, samples: int
) -> tuple[Array, Array, Array]:
    """Return Λ_0; (I - P Λ_k) A^k near the start; smoothed covariances near both ends (of all
    samples where these meet).
    """
    f, reach = observer.filter, observer.settled
    count = min(samples, reach)
    known = information(observer, end, count)
    near = np.arange(samples)
    if samples > 2 * reach:
        near = np.concatenate([near[:reach], near[samples - reach :]])
    weight = known[:, np.minimum(samples - near, count)]
    prior = f.prior[:, None]
    power = chain.powers(f.predictor, count)[:, :count]
    felt = (np.eye(f.order) - prior @ weight[:, :count]) @ power
    covariance = prior - prior @ weight @ prior
    spread = spread_of(excess, known[:, -1])[:, None]
    covariance[:, :count] += felt @ spread @ felt.swapaxes(2, 3)
    return known[:, -1], felt, covariance


def _smooth_gap(
    observer: Observer, stretch: _Stretch, later: _Later, out: Array
) -> tuple[_Later, list[tuple[int, Array]]]:
    """Put together the prediction from the left and the information from the right of a gap."""
    count = stretch.last - stretch.first
    ahead = predict_gap(observer, stretch.prior, count)
    away, noise = gap_covariance(observer, count)
    away, noise = away[:, :0:-1], noise[:, :0:-1]  # from each missing sample to the end of the gap
    eye, j = np.eye(observer.order), later.information[:, None]
    carry = away.swapaxes(2, 3) @ np.linalg.inv(eye + j @ noise)
    known, pull = carry @ j @ away, carry @ later.pull[:, None, :, None]
    spread = np.asarray(np.linalg.solve(eye + ahead.covariance @ known, ahead.covariance))
    states = (ahead.states[..., None] + spread @ pull)[..., 0]
    out[:] = states.swapaxes(1, 2) * observer.rate[..., None]
    return _Later(known[:, 0], pull[:, 0, :, 0]), [(0, observer.deviations(spread))]


def _stationary(observer: Observer, y: Run, mean: Array, end: Array, out: Array) -> Array:
    """Smooth a run from state `mean` to λ `end`, into `out`; return λ at the start."""
    pieces = chunks(y.samples)
    means = [mean] if len(pieces) == 1 else advance(observer, y, mean)[:-1]
    whole = _kernel(observer, BLOCK)
    for (a, b), before in zip(reversed(pieces), reversed(means), strict=True):
        end = _chunk(observer, whole, y.take(a, b), before, end, out[:, :, a:b])
        out[:, 0, a:b] += y.offset[:, None]
    return end


def _chunk(
    observer: Observer, whole: _Kernel, y: Array, mean: Array, end: Array, out: Array
) -> Array:
    """Smooth `y` (joints, samples) at once: blocks forward, blocks backward, and all states."""
    n = observer.order
    blocks, after = block_starts(observer, y, mean, spare=n)
    count = blocks.shape[1]
    rest = y.shape[1] - count * BLOCK
    if rest:
        kernel = _kernel(observer, rest)
        tail = np.concatenate([y[:, -rest:], after, end], axis=1)[:, None]
        out[:, :, -rest:] = (tail[:, None] @ kernel.states)[:, :, 0]
        end = (tail[:, :, :-n] @ kernel.adjoint)[:, 0] + (end[:, None] @ kernel.across)[:, 0]
    if count:
        drive = np.empty((len(y), count + 1, n))  # from the last block to the first
        drive[:, 0] = end
        drive[:, 1:] = (blocks[:, :, :-n] @ whole.adjoint)[:, ::-1]
        chain.scan(whole.across.swapaxes(1, 2), drive)
        blocks[:, :, -n:] = drive[:, -2::-1]
        target = out[:, :, : count * BLOCK].reshape(*out.shape[:2], count, BLOCK)
        np.matmul(blocks[:, None], whole.states, out=target)
        end = drive[:, -1]
    return end


def _kernel(observer: Observer, size: int) -> _Kernel:
    """Fold predictions forward, innovations, λ backward and x + P λ of a block into one matrix."""
    f = observer.filter
    power = chain.powers(f.predictor, size)
    free = power[:, :size].transpose(0, 2, 3, 1)  # (joints, state, from state, sample)
    pulse = (power[:, : size - 1] @ (f.transition @ f.gain[..., None])[:, None])[..., 0]
    late = np.concatenate([np.zeros((len(pulse), 1, f.order)), pulse], axis=1).swapaxes(1, 2)
    forward = np.concatenate([chain.impulse_toeplitz(late), free], axis=2)
    surprise = -forward[:, :1]
    surprise[:, 0, :size] += np.eye(size)
    row = (power[:, :size, 0] * f.remainder[:, None, None]).swapaxes(1, 2)
    backward = chain.impulse_toeplitz(row).swapaxes(2, 3)  # (joints, λ, innovation, sample)
    spread = np.einsum("nst,ntji->nsji", f.prior, backward)
    end = np.einsum("nst,niut->nsui", f.prior, power[:, size:0:-1])
    states = np.concatenate([forward + surprise @ spread, end], axis=2)
    adjoint = (surprise @ backward[..., :1])[..., 0].transpose(0, 2, 1)
    return _Kernel(states * observer.rate[..., None, None], adjoint, power[:, size])
