"""The logs of rrr-healthy/: every kind of experiment on a healthy machine."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import numpy as np

from bench import experiments
from bench.config import SAMPLE_TIME
from bench.experiments import Experiment
from bench.machine import Machine
from bench.motions import Reference
from pipelines.io.log import ExperimentLog
from pipelines.writing.task import writing_task
from sample_logs.bench_session import controllers_model, machine, recorded

RECORDED = datetime(2026, 3, 2, 9, 0)  # UTC
# Times the machine's gains: PD alone then errs by millimetres, as in Kostić et al. 2004, Table IV.
WRITING_STIFFNESS = 1.1  # numerics


def text(machine: Machine, words: str) -> Reference:
    """Return the joint motion that writes `words`."""
    motion = writing_task(machine.described, words).sampled(SAMPLE_TIME).motion
    return Reference(motion.t, motion.q, motion.dq, motion.ddq)


def plans(machine: Machine) -> Iterator[Experiment]:
    """Yield the whole session."""
    model, joints = controllers_model(machine), (1, 2, 3)
    yield from (experiments.friction(machine, joint, seed=1) for joint in joints)
    yield experiments.hold(np.array([0.4, 0.6, -1.1]), 1)
    yield experiments.hold(np.array([0.0, -1.2, 0.8]), 2)
    yield experiments.excitation(machine, seed=1, periods=3)
    yield experiments.excitation(machine, seed=2, periods=2).judging()
    yield experiments.free(machine, seed=1)
    yield from (experiments.reversal(machine, joint) for joint in joints)
    yield from experiments.writing(text(machine, "RRRID"), model, WRITING_STIFFNESS)
    bent, straight, _ = experiments.frf_postures(machine)
    for seed, posture in ((1, bent), (2, straight)):
        for joint in joints:  # eight periods of the excitation
            yield experiments.frf(machine, joint, posture, model, seed, duration=32.0)


def healthy_logs(only: str | None = None) -> Iterator[tuple[str, ExperimentLog]]:
    """Yield every log of `rrr-healthy/`, after the name of its file; or the one of this name."""
    at_hand = machine()
    return recorded(at_hand, plans(at_hand), RECORDED, seed=1, only=only)
