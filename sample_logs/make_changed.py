"""The logs of rrr-changed/: the machine of rrr-healthy/ before and after something happened to it.

What happened stands at the end of this file, and of README.md: do not read there what the logs can
tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

from bench import experiments
from bench.experiments import FEEDFORWARD, Experiment
from bench.faults.drive import Cogging
from bench.machine import Fault, Machine
from pipelines.io.log import ExperimentLog
from sample_logs.bench_session import controllers_model, machine, recorded
from sample_logs.make_healthy import WRITING_STIFFNESS, text

BEFORE, AFTER = datetime(2026, 3, 4, 10, 0), datetime(2026, 5, 18, 9, 0)  # UTC, when each began


def plans_before(machine: Machine) -> Iterator[Experiment]:
    """Yield the commissioning: what the machine did when it was healthy."""
    yield experiments.excitation(machine, seed=3).before()
    yield experiments.free(machine, seed=3, duration=15.0).before()


def plans_after(machine: Machine) -> Iterator[Experiment]:
    """Yield the same again, and what is held out."""
    yield from (experiments.friction(machine, joint, seed=3, duration=15.0) for joint in (1, 2, 3))
    yield experiments.excitation(machine, seed=3)
    yield experiments.excitation(machine, seed=4).judging()
    yield experiments.free(machine, seed=3, duration=15.0)
    yield experiments.free(machine, seed=4, duration=15.0).judging()
    cases = experiments.writing(
        text(machine, "RRRID"), controllers_model(machine), WRITING_STIFFNESS
    )
    yield cases[experiments.WRITING_CASES.index(FEEDFORWARD)]


def changed_logs(only: str | None = None) -> Iterator[tuple[str, ExperimentLog]]:
    """Yield every log of `rrr-changed/`, after the name of its file; or the one of this name."""
    at_hand = machine()
    yield from recorded(at_hand, plans_before(at_hand), BEFORE, seed=2, only=only)
    yield from recorded(at_hand, plans_after(at_hand), AFTER, _what_happened(), seed=3, only=only)


def _what_happened() -> tuple[Fault, ...]:
    """Return the fault: magnets in the motor of joint 2 that pull its rotor into 18 places a
    turn.
    """
    return (Cogging(2, order=18.0, amplitude=0.35, phase=0.8, second_phase=2.1),)
