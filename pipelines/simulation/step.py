"""Choose the integrator's step: as large as its error allows, a tenth of what noise does.

    simulated = simulate(arm, experiment, noise, seeds=range(10))

The error is measured: stretches of the experiment are run with m steps a sample and with 2 m,
without noise and quantisation; two runs with different noise say what may be wrong.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

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
    random = np.zeros(experiment.n_joints)
    if noise is not None and (noise.torque.any() or noise.position.any()):
        runs = run_together(plant, stretches[:2], SIMULATION.ample, noise, (1, 2), exact=False)
        random = _rms([one.true_q[0] for one in runs], [one.true_q[1] for one in runs])
    counted = experiment.resolution / np.sqrt(6.0)  # of the difference of two unrelated counts
    allowed = np.maximum(SIMULATION.share * np.maximum(random, counted), SIMULATION.unheard)
    ideal = np.zeros(experiment.n_joints)
    smooth = replace(experiment.controller, torque_resolution=None)
    calm = [replace(stretch, controller=smooth, resolution=ideal) for stretch in stretches]
    error, coarse = np.full_like(allowed, np.inf), None
    for steps in SIMULATION.steps:
        fine = _positions(plant, calm, 2 * steps)
        for exact in (False, True):
            rough = coarse if exact else None
            error = _rms(rough or _positions(plant, calm, steps, exact), fine)
            if (error <= allowed).all():
                return Step(steps, error, exact)
        coarse = fine
    words = f"with {steps} steps a sample the simulation still is {error.max():.2g} rad off"
    remedy = "friction that changes sign within a very small speed needs a lower sharpness"
    raise InputRejected("D17", words, remedy=remedy)


def _stretches(experiment: Experiment) -> list[Experiment]:
    """Return parts of it that are the hardest to follow.

    They lie where the arm starts, where joints reverse most often and friction turns over, and
    where they are fastest or accelerate hardest.
    """
    length = max(2, round(SIMULATION.stretch / experiment.sample_time))
    length = min(experiment.n_samples, length)
    speed = experiment.dq_ref
    reversals = np.diff(np.signbit(speed), axis=0).astype(float)
    starts = [0]
    for activity in (reversals, speed[1:] ** 2, np.diff(speed, axis=0) ** 2):
        share = activity / np.maximum(activity.sum(axis=0), 1e-300)  # numerics: of each joint's
        moved = np.convolve(share.sum(axis=1), np.ones(length - 1), mode="valid")
        starts.append(int(np.argmax(moved)))
    return [experiment.part(first, length) for first in dict.fromkeys(starts)]


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


def _rms(some: list[Array], others: list[Array]) -> Array:
    """Return the largest rms difference of any pair (joints,); infinite where one ran away."""
    each = [np.sqrt(np.mean((a - b) ** 2, axis=0)) for a, b in zip(some, others, strict=True)]
    return np.asarray(np.where(np.isfinite(each), each, np.inf).max(axis=0))
