"""The logs of rrr-healthy/: every kind of experiment on a machine that is in order."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import numpy as np

from bench import experiments
from bench.config import SAMPLE_TIME
from bench.experiments import Experiment
from bench.machine import Machine
from bench.motions import Reference
from pipelines.io.experiment import ExperimentLog
from pipelines.model.writing.reference import writing_task
from sample_logs.bench_session import controllers_model, machine, recorded

__all__ = ["RECORDED", "WRITING_STIFFNESS", "healthy_logs", "plans", "text"]

RECORDED = datetime(2026, 3, 2, 9, 0)  # UTC
POSTURES = ((0.4, 0.6, -1.1), (0.0, -1.2, 0.8))  # [rad] at rest
WRITING_STIFFNESS = 1.1  # times the machine's gains: PD alone then errs by millimetres, as in Kostić et al. 2004, Table IV
FRF_SECONDS = 32.0  # eight periods of the excitation


def text(machine: Machine, words: str) -> Reference:
    """The joint motion that writes `words`."""
    motion = writing_task(machine.described, words).sampled(SAMPLE_TIME).motion
    return Reference(motion.t, motion.q, motion.dq, motion.ddq)


def plans(machine: Machine) -> Iterator[Experiment]:
    """The whole session."""
    model, joints = controllers_model(machine), (1, 2, 3)
    yield from (experiments.friction(machine, joint, seed=1) for joint in joints)
    yield from (experiments.hold(np.array(posture), number) for number, posture in enumerate(POSTURES, start=1))
    yield experiments.excitation(machine, seed=1, periods=3)
    yield experiments.excitation(machine, seed=2, periods=2).judging()
    yield experiments.free(machine, seed=1)
    yield from (experiments.reversal(machine, joint) for joint in joints)
    yield from experiments.writing(text(machine, "RRRID"), model, WRITING_STIFFNESS)
    bent, straight, _ = experiments.frf_postures(machine)
    for seed, posture in ((1, bent), (2, straight)):
        yield from (experiments.frf(machine, joint, posture, model, seed, FRF_SECONDS) for joint in joints)


def healthy_logs(only: str | None = None) -> Iterator[tuple[str, ExperimentLog]]:
    """Every log of `rrr-healthy/`, after the name of its file; or the one of this name."""
    at_hand = machine()
    return recorded(at_hand, plans(at_hand), RECORDED, seed=1, only=only)
