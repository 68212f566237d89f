"""The simulation of an arm model: closed-loop forward dynamics with friction and effects, many replicas at once.

    experiment = Experiment.of_log(log)                    references, controller and encoders of a log
    simulated = simulate(arm, experiment, noise, seeds=range(10))
    simulated.q, simulated.tau                             (replicas, samples, joints): what each replica would have logged

    windows = simulate_windows(Plant.of(arm), motion, tau, …)      where the controller is unknown
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Array
from pipelines.model.simulation.accuracy import Step, choose_step
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.one_loop import OneLoop
from pipelines.model.simulation.plant import Plant
from pipelines.model.simulation.replicas import Noise, Simulated, run, run_together
from pipelines.model.simulation.windows import Windows, simulate_windows

__all__ = ["Experiment", "Noise", "Plant", "Simulated", "Step", "Windows", "choose_step", "choose_steps", "run",
           "runs_alone", "simulate", "simulate_together", "simulate_windows"]


def simulate(arm: Arm, experiment: Experiment, noise: Noise | None = None, seeds: Iterable[int] = (0,), p: Array | None = None,
             step: Step | None = None) -> Simulated:
    """What `arm` would have logged in `experiment`, once for each seed.

    Args:
        noise: of drives and encoders; none where left out.
        p: (replicas, parameters) base parameters of each replica, where they differ.
        step: of the integrator; by default as long as `choose_step` allows.

    Raises:
        InputRejected: D17, the arm runs away, or no step is small enough.
        ValueError: p does not fit the arm or the seeds.
    """
    seeds = tuple(seeds)
    if p is not None and len(p) != len(seeds):
        raise ValueError(f"p has {len(p)} rows for {len(seeds)} seeds")
    plant = Plant.of(arm, p)
    step = choose_step(plant, experiment, noise) if step is None else step
    return run(plant, experiment, step.per_sample, noise, seeds, step.exact)


def choose_steps(arm: Arm, experiments: Sequence[Experiment], noise: Noise | None = None) -> dict[float, Step]:
    """Those of the integrator for each sample time, as `simulate_together` takes them: fine enough for all of the experiments.

    Raises:
        InputRejected: as `choose_step`.
    """
    plant, found = Plant.of(arm), dict[float, Step]()
    for time in dict.fromkeys(one.sample_time for one in experiments):
        chosen = [choose_step(plant, one, noise) for one in experiments if one.sample_time == time]
        found[time] = replace(max(chosen, key=lambda step: step.per_sample), exact=any(step.exact for step in chosen))
    return found


def runs_alone(arm: Arm, experiment: Experiment) -> bool:
    """Return whether each replica is simulated by itself, so that several at once save nothing."""
    return OneLoop.fits(Plant.of(arm), experiment)


def simulate_together(arm: Arm, experiments: Sequence[Experiment], noise: Noise | None = None, seeds: Iterable[int] = (0,),
                      steps: Mapping[float, Step] | None = None) -> list[Simulated]:
    """`simulate` of several experiments, side by side as far as their sample times agree; the step is fine enough for all.

    Args:
        steps: of the integrator, for each sample time [s]; by default as long as `choose_step` allows.

    Raises:
        InputRejected: D17, the arm runs away, or no step is small enough.
    """
    plant, drawn, found = Plant.of(arm), tuple(seeds), dict[int, Simulated]()
    known = choose_steps(arm, experiments, noise) if steps is None else steps
    for time in dict.fromkeys(one.sample_time for one in experiments):
        places = [k for k, one in enumerate(experiments) if one.sample_time == time]
        some, step = [experiments[k] for k in places], known[time]
        found |= dict(zip(places, run_together(plant, some, step.per_sample, noise, drawn, step.exact), strict=True))
    return [found[k] for k in range(len(experiments))]
