"""The control cases that nobody recorded: simulated on the controller of a log, with a plant and a model that differ.

The plant is the fitted model plus what the model leaves of the torque of that log, replayed over time: friction, flexibility and
whatever else it lacks. The controller's model is another draw of the same fit, or case 6 would be perfect by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.log import Array, ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.draw import drawn
from pipelines.model.effects.base import Hooks
from pipelines.model.rigid.body import Motion
from pipelines.model.simulation.accuracy import choose_step
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.plant import Plant
from pipelines.model.simulation.replicas import Simulated, run
from pipelines.model.writing.cases import CASES, Case, TipStd, tip_std, track

__all__ = ["Draws", "possible", "simulated_cases", "why_not"]

_FOLLOWED = ("pd", "pd+feedforward")


@dataclass(frozen=True)
class Draws:
    """How many models the controller runs on in turn."""

    count: int = 5
    seed: int = 1


def why_not(log: ExperimentLog) -> str:
    """Why no case can be simulated on this log's controller; empty where it can."""
    if log.controller is not None and log.controller.law not in (*_FOLLOWED, "unknown"):
        return f"its controller, {log.controller.law}, is not PD with or without feed-forward"
    try:
        Experiment.of_log(log)
    except InputRejected as lacking:
        return lacking.message
    return ""


def possible(log: ExperimentLog, cases: Sequence[int]) -> tuple[list[int], str]:
    """Those of `cases` whose feed-forward this log's references tell, and why others are missing."""
    some = [case for case in cases if "ddq_ref" in log or "inertia" not in CASES[case - 1]]
    lacking = ", ".join(str(case) for case in cases if case not in some)
    return some, f"cases {lacking} would have inertia ahead, and {log.name} has no signal ddq_ref; log it" if lacking else ""


def simulated_cases(log: ExperimentLog, arm: Arm, left: Array, cases: Sequence[int], draws: Draws) -> dict[int, Case]:
    """`cases` on the controller and the reference of `log` (a recording whose controller is PD, with or without feed-forward).

    Args:
        left: measured minus modelled torque of that log (samples, joints) [N m], low-passed.

    Raises:
        InputRejected: D15, D17, the model cannot be simulated.
    """
    told = Experiment.of_log(log)
    bare = replace(told, controller=replace(told.controller, law="pd", feedforward=None, model=None), feedforward_arm=None)
    plant = Plant.of(arm)
    plant = replace(plant, hooks=(*plant.hooks, _replayed(left, bare)))
    step = choose_step(plant, bare)
    ahead, owners = _ahead(bare, arm, cases, draws)
    done = run(plant, replace(bare, v=_with(bare.v, ahead)), step.per_sample, None, range(len(owners)), step.exact)
    return {case: _case(case, log, done, [k for k, owner in enumerate(owners) if owner == case]) for case in cases}


def _replayed(left: Array, experiment: Experiment) -> Hooks:
    """`left` as a load over time, between samples on a straight line."""
    last = len(left) - 2

    def load(motion: Motion, states: Array) -> Array:
        del states
        place = (float(motion.t[0]) - experiment.start_time) / experiment.sample_time  # of all replicas the same
        k = min(max(int(place), 0), last)
        share = min(max(place - k, 0.0), 1.0)
        return np.asarray((1.0 - share) * left[k:k + 1] + share * left[k + 1:k + 2])

    return Hooks(load=load)


def _ahead(experiment: Experiment, arm: Arm, cases: Sequence[int], draws: Draws) -> tuple[Array, list[int]]:
    """The feed-forward (samples, joints, replicas) [N m], and whose case each replica is: case 1 once, the others by every draw."""
    T, N = experiment.sample_time, experiment.n_samples
    motion = Motion(experiment.start_time + T * np.arange(N, dtype=np.float64), experiment.q_ref, experiment.dq_ref,
                    experiment.ddq_ref)
    rng = np.random.default_rng([24, draws.seed])
    models = [drawn(arm, rng).nominal.torque_parts(motion) for _ in range(draws.count)]
    columns, owners = [], []
    for case in cases:
        for parts in models if CASES[case - 1] else models[:1]:
            columns.append(sum((getattr(parts, name) for name in CASES[case - 1]), np.zeros(experiment.q_ref.shape)))
            owners.append(case)
    return np.stack(columns, axis=-1), owners


def _with(v: Array | None, ahead: Array) -> Array:
    return ahead if v is None else ahead + v[..., None]


def _case(case: int, log: ExperimentLog, done: Simulated, replicas: Sequence[int]) -> Case:
    each = np.array([tip_std(log, done.true_q[k]) for k in replicas])
    spread = TipStd.of(each.std(axis=0, ddof=1)) if len(replicas) > 1 else None
    return Case(case, CASES[case - 1], TipStd.of(np.sqrt(np.mean(each**2, axis=0))), spread, "simulated", (log.name,),
                track(log, done.true_q[replicas[0]]))
