"""Record experiments on a machine, and name its faults.

    logs = record(machine, faults, experiments, seed)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bench.controllers import OpenLoop
from bench.experiments import Experiment
from bench.fault import Fault
from bench.machine import SAMPLE_TIME, Machine
from bench.plant import Recording, run
from pipelines.io import schema
from pipelines.io.experiment import ExperimentLog, Signal
from pipelines.io.robot import format_robot

__all__ = ["answer", "as_log", "peak_torque", "record"]


def record(machine: Machine, faults: Sequence[Fault], experiments: Iterable[Experiment], seed: int = 0) -> list[ExperimentLog]:
    """The log of each experiment, on the machine with these faults."""
    return [as_log(machine, one, run(machine, one.law, one.reference, faults, seed=1000 * seed + place))
            for place, one in enumerate(experiments)]


def as_log(machine: Machine, experiment: Experiment, recording: Recording) -> ExperimentLog:
    """What the recorder of the machine would have written: nothing of it tells a fault."""
    reference = recording.reference
    values = {"t": recording.t, "q": recording.q, "tau": recording.tau, **recording.extras,
              **dict(zip(("q_obs", "dq_obs", "ddq_obs"), recording.observed, strict=True))}
    if not isinstance(experiment.law, OpenLoop):
        values |= {"q_ref": reference.q, "dq_ref": reference.dq, "ddq_ref": reference.ddq}
    law = recording.controller.law
    signals = {name: Signal(array, schema.unit_of(name, law), schema.SIGNALS[name][1]) for name, array in values.items()}
    robot = machine.described
    return ExperimentLog(
        name=experiment.name, experiment=experiment.kind, role=experiment.role, origin="simulated", robot_name=robot.name,
        sample_time=SAMPLE_TIME, robot_text=format_robot(robot), signals=signals, joint=experiment.joint,
        posture=experiment.posture, period=experiment.period, controller=recording.controller)


def peak_torque(logs: Iterable[ExperimentLog]) -> tuple[float, ...]:
    """Largest torque (n,) [N m] of each joint over `logs`: what a saturation's strength is measured by."""
    return tuple(np.max([np.abs(log.tau).max(axis=0) for log in logs], axis=0).tolist())


def answer(faults: Iterable[Fault]) -> list[dict[str, object]]:
    """Cause, joint and parameters of each fault, named as findings name them; "unknown" for one outside the library."""
    return [{"cause": fault.name if fault.known else "unknown", "kind": fault.name, "joint": fault.joint,
             "parameters": fault.parameters()} for fault in faults]
