"""Choose the integrator's step: as large as its error allows, which is a tenth of what different noise does.

The error is measured, not guessed: stretches of the experiment are run with m steps a sample and with 2m of Runge-Kutta, without
noise and without quantisation, whose flips would hide it; two runs with different noise say what may be wrong.

A body that is held costs less a step, and takes off less of the error where steps that are short together share it. Where that is
too much, or nothing is random and nothing counts, m steps that hold nothing do. Of an arm in plain numbers they may cost less than
2m that hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.model.rigid.body import Array
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.integrate import HeldBody
from pipelines.model.simulation.one_loop import OneLoop
from pipelines.model.simulation.plant import Plant
from pipelines.model.simulation.replicas import Noise, run_together

__all__ = ["Step", "choose_step"]

_STRETCH = 0.25  # [s] length of a stretch that is tried
_SHARE = 0.1  # of the noise difference that the step may cause
_CANDIDATES = (1, 2, 4, 8, 16, 32, 64)  # steps a sample
_AMPLE = 8  # steps a sample, where noise is what matters
_GAIN = 4.0  # what halving the step divides the error by, about: of order 2 is a body held over each, of order 4 what holds none
_UNHEARD = 1e-9  # [rad] tolerance where nothing is random and nothing counts steps


@dataclass(frozen=True)
class Step:
    """How many integrator steps a sample, and what that was judged by. Arrays per joint."""

    per_sample: int
    error: Array  # [rad] rms, largest of the stretches, measured by halving; of twice the steps that were tried, what that leaves
    noise: Array  # [rad] rms difference of two runs with different noise
    allowed: Array  # [rad]
    exact: bool  # the rigid body is nowhere held


def choose_step(plant: Plant, experiment: Experiment, noise: Noise | None = None) -> Step:
    """The fewest steps a sample whose error is at most a tenth of the difference that noise makes.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the arm runs away however small the step, or
            the step would be too small to be of use.
    """
    one = plant if plant.p.ndim == 1 else replace(plant, p=plant.p[0])
    one.refuse_unphysical(experiment.q_ref[:1])
    stretches = [experiment.part(first, samples) for first, samples in _stretches(experiment)]
    random = _noise_difference(one, stretches[:2], noise or Noise.none(experiment.n_joints))
    counted = experiment.resolution / np.sqrt(6.0)  # of the difference of two counts that have nothing to do with each other
    allowed = np.maximum(_SHARE * np.maximum(random, counted), _UNHEARD)
    calm = [_without_steps(stretch) for stretch in stretches]
    coarse, left = None, np.inf
    for steps in _CANDIDATES:
        fine = _positions(one, calm, 2 * steps, exact=True)
        for count, error, exact in _tried(one, calm, steps, fine, coarse):
            if (error <= allowed).all():
                return Step(count, error, random, allowed, exact)
            left = float(error.max()) if count == steps else left
        coarse = fine
    raise InputRejected("D17", f"with {_CANDIDATES[-1]} steps a sample the simulation still is {left:.2g} rad off",
                        remedy="friction that changes sign within a very small speed needs a lower sharpness")


def _tried(plant: Plant, calm: list[Experiment], steps: int, fine: list[Array],
           known: list[Array] | None) -> Iterator[tuple[int, Array, bool]]:
    """Steps a sample, their error (joints,) [rad] and whether they hold nothing, as they are to be preferred: `steps`, and twice as
    many by what that takes off. Of an arm in plain numbers two steps that hold cost little more than one that does not, which would
    have to be tried.

    Args:
        fine: what twice as many that hold nothing come to; `known`: what `steps` of them do, where somebody knows.
    """
    finer, arrays = 2 * steps, HeldBody.fits(plant.prepared(1))
    numbers = all(OneLoop.fits(plant, one) for one in calm)
    held = _rms(_positions(plant, calm, steps, exact=False), fine) if arrays or numbers else None
    shared = arrays and HeldBody.together(calm[0].sample_time, finer) > 1  # it is held for as long as before
    if held is not None:
        yield steps, held, False
        if not shared and (arrays or steps == 1):
            yield finer, held / _GAIN, False
    error = _rms(_positions(plant, calm, steps, exact=True) if known is None else known, fine)
    yield steps, error, True
    if held is not None and numbers and steps > 1:
        yield finer, held / _GAIN, False
    yield finer, error / _GAIN, True


def _stretches(experiment: Experiment) -> list[tuple[int, int]]:
    """Where the arm starts, where joints reverse most often and friction turns over, and where they are fastest, accelerate
    hardest, or are driven hardest."""
    length = min(experiment.n_samples, max(2, round(_STRETCH / experiment.sample_time)))
    speed = experiment.dq_ref
    activities = [np.diff(np.signbit(speed), axis=0) != 0, speed[1:] ** 2, np.diff(speed, axis=0) ** 2]
    if experiment.tau is not None:
        activities.append(experiment.tau[1:] ** 2)
    starts = [int(np.argmax(np.convolve(_share(x), np.ones(length - 1), mode="valid"))) for x in activities]
    return [(first, length) for first in dict.fromkeys([0, *starts])]


def _share(activity: npt.NDArray[Any]) -> Array:
    """(samples,) of (samples, joints): each joint's part of what it does in all, summed over the joints."""
    return np.asarray((activity / np.maximum(activity.sum(axis=0), 1e-300)).sum(axis=1))


def _without_steps(experiment: Experiment) -> Experiment:
    """The same with ideal encoders and commands of any fineness."""
    controller = replace(experiment.controller, torque_resolution=None)
    return replace(experiment, controller=controller, resolution=np.zeros(experiment.n_joints))


def _positions(plant: Plant, stretches: list[Experiment], steps: int, exact: bool) -> list[Array]:
    """True positions (samples, joints) of each stretch; not a number where the arm runs away: the step is too large then."""
    with np.errstate(all="ignore"):
        try:
            return [one.true_q[0] for one in run_together(plant, stretches, steps, exact=exact)]
        except (InputRejected, OverflowError):
            if len(stretches) == 1:
                return [np.full(stretches[0].q_ref.shape, np.nan)]
    return [position for stretch in stretches for position in _positions(plant, [stretch], steps, exact)]


def _noise_difference(plant: Plant, stretches: list[Experiment], noise: Noise) -> Array:
    """Rms difference [rad] (joints,) of two runs with different noise."""
    if not (noise.torque.any() or noise.position.any()):
        return np.zeros(len(noise.torque))
    both = [one.true_q for one in run_together(plant, stretches, _AMPLE, noise, (1, 2), exact=False)]
    return _rms([some for some, _ in both], [other for _, other in both])


def _rms(some: list[Array], others: list[Array]) -> Array:
    """The largest rms difference of any pair (joints,); infinite where one of them ran away."""
    each = np.array([np.sqrt(np.mean((a - b) ** 2, axis=0)) for a, b in zip(some, others, strict=True)])
    return np.asarray(np.where(np.isfinite(each), each, np.inf).max(axis=0))
