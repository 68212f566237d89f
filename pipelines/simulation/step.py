"""Choose the integrator's step: as large as its error allows, a tenth of what noise does.

    simulated = simulate(arm, experiment, noise, seeds=range(10))

The error is measured, not guessed: stretches of the experiment are run with m steps a sample and
with 2 m of Runge-Kutta, without noise and without quantisation, whose flips would hide it; two runs
with different noise say what may be wrong. A body that is held costs less a step: it is tried
first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.io.log import Array
from pipelines.simulation.closed_loop import Noise, Simulated, run, run_together
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant

__all__ = ["Step", "choose_step", "simulate"]


@dataclass(frozen=True)
class Step:
    """How many integrator steps a sample, and what that was judged by. Arrays per joint."""

    per_sample: int
    error: Array  # [rad] rms, largest of the stretches, measured by halving
    noise: Array  # [rad] rms difference of two runs with different noise
    allowed: Array  # [rad]
    exact: bool  # the rigid body is nowhere held


def simulate(
    arm: Arm,
    experiment: Experiment,
    noise: Noise | None = None,
    seeds: Iterable[int] = (0,),
    step: Step | None = None,
) -> Simulated:
    """Return what `arm` would have logged in `experiment`, once for each seed.

    Args:
        noise: of drives and encoders; none where left out.
        step: of the integrator; by default as long as `choose_step` allows.

    Raises:
        InputRejected: D17, the arm runs away, or no step is small enough.
    """
    plant = Plant.of(arm)
    step = choose_step(plant, experiment, noise) if step is None else step
    return run(plant, experiment, step.per_sample, noise, seeds, step.exact)


def choose_step(plant: Plant, experiment: Experiment, noise: Noise | None = None) -> Step:
    """Return the fewest steps a sample whose error is at most a tenth of what noise does.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the arm runs away
            however small the step, or the step would be too small to be of use.
    """
    plant.refuse_unphysical(experiment.q_ref[:1])
    stretches = _stretches(experiment)
    random = _noise_difference(plant, stretches[:2], noise or Noise.none(experiment.n_joints))
    counted = experiment.resolution / np.sqrt(6.0)  # of the difference of two unrelated counts
    allowed = np.maximum(SIMULATION.share * np.maximum(random, counted), SIMULATION.unheard)
    calm = [_without_steps(stretch) for stretch in stretches]
    coarse: list[Array] | None = None
    for steps in SIMULATION.steps:
        fine = _positions(plant, calm, 2 * steps)
        error = _rms(_positions(plant, calm, steps, exact=False), fine)
        if (error <= allowed).all():
            return Step(steps, error, random, allowed, exact=False)
        error = _rms(_positions(plant, calm, steps) if coarse is None else coarse, fine)
        if (error <= allowed).all():
            return Step(steps, error, random, allowed, exact=True)
        coarse = fine
    raise InputRejected(
        "D17",
        f"with {SIMULATION.steps[-1]} steps a sample the simulation still is "
        f"{float(error.max()):.2g} rad off",
        remedy="friction that changes sign within a very small speed needs a lower sharpness",
    )


def _stretches(experiment: Experiment) -> list[Experiment]:
    """Return parts of it that are the hardest to follow.

    They lie where the arm starts, where joints reverse most often and friction turns over, and
    where they are fastest, accelerate hardest, or are driven hardest.
    """
    length = max(2, round(SIMULATION.stretch / experiment.sample_time))
    length = min(experiment.n_samples, length)
    speed = experiment.dq_ref
    activities: list[npt.NDArray[Any]] = [
        np.diff(np.signbit(speed), axis=0) != 0,
        speed[1:] ** 2,
        np.diff(speed, axis=0) ** 2,
    ]
    if experiment.tau is not None:
        activities.append(experiment.tau[1:] ** 2)
    starts = [0]
    for activity in activities:
        share = activity / np.maximum(activity.sum(axis=0), 1e-300)  # numerics: of each joint's
        moved = np.convolve(share.sum(axis=1), np.ones(length - 1), mode="valid")
        starts.append(int(np.argmax(moved)))
    return [experiment.part(first, length) for first in dict.fromkeys(starts)]


def _without_steps(experiment: Experiment) -> Experiment:
    """Return the same with ideal encoders and commands of any fineness."""
    controller = replace(experiment.controller, torque_resolution=None)
    ideal = np.zeros(experiment.n_joints)
    return replace(experiment, controller=controller, resolution=ideal)


def _positions(
    plant: Plant, stretches: list[Experiment], steps: int, exact: bool = True
) -> list[Array]:
    """Return true positions (samples, joints) of each stretch; not numbers where it runs away."""
    with np.errstate(all="ignore"):
        try:
            return [one.true_q[0] for one in run_together(plant, stretches, steps, exact=exact)]
        except (InputRejected, OverflowError):
            if len(stretches) == 1:
                return [np.full(stretches[0].q_ref.shape, np.nan)]
    return [q for stretch in stretches for q in _positions(plant, [stretch], steps, exact)]


def _noise_difference(plant: Plant, stretches: list[Experiment], noise: Noise) -> Array:
    """Return the rms difference [rad] (joints,) of two runs with different noise."""
    if not (noise.torque.any() or noise.position.any()):
        return np.zeros(len(noise.torque))
    runs = run_together(plant, stretches, SIMULATION.ample, noise, (1, 2), exact=False)
    both = [one.true_q for one in runs]
    return _rms([some for some, _ in both], [other for _, other in both])


def _rms(some: list[Array], others: list[Array]) -> Array:
    """Return the largest rms difference of any pair (joints,); infinite where one ran away."""
    each = [np.sqrt(np.mean((a - b) ** 2, axis=0)) for a, b in zip(some, others, strict=True)]
    return np.asarray(np.where(np.isfinite(each), each, np.inf).max(axis=0))
