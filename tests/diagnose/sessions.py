"""Short sessions on the virtual test bench, with a fault or without: what the stages `diagnose` and `extend` are asked about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from bench import experiments
from bench.draw import draw_machine
from bench.faults import make
from bench.plant import record
from pipelines.effects import effect_names
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog

__all__ = ["but", "healthy_again", "session", "written"]

_MACHINE = 7


@lru_cache(maxsize=8)
def session(cause: str = "", joint: int | None = None, seconds: float = 3.0, logs: int = 2,
            seed: int = 1) -> tuple[ExperimentLog, ...]:
    """Excitations of role identify, the last one of role validate where there are several; `cause` at full strength."""
    machine = draw_machine(_MACHINE, "fault")
    plans = [replace(experiments.excitation(machine, seed + k, seconds, 1), name=f"excitation-{k + 1}",
                     role="validate" if 0 < k == logs - 1 else "identify") for k in range(logs)]
    faults = (make(cause, machine, joint, 1, 1.0),) if cause else ()
    return tuple(record(machine, faults, plans, seed))


def written(folder: Path, logs: Sequence[ExperimentLog]) -> Path:
    """A folder that holds these logs."""
    folder.mkdir(parents=True, exist_ok=True)
    for log in logs:
        write_log(folder / f"{log.name}.h5", log)
    return folder


def but(*kept: str) -> tuple[str, ...]:
    """Every cause but these: a search for few is quick."""
    return tuple(sorted(set(effect_names()) - set(kept)))


def healthy_again(logs: Sequence[ExperimentLog]) -> tuple[ExperimentLog, ...]:
    """Logs of role identify as reference logs of another name."""
    return tuple(replace(log, name=f"{log.name}-before", role="reference") for log in logs if log.role == "identify")
