"""Make one log of signals in SI: what the recipe, the file's name and its `[[file]]` case say of it."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, UsageError, clean
from pipelines.log import schema
from pipelines.log.derive import created
from pipelines.log.experiment import Array, Controller, Derived, ExperimentLog, Signal
from pipelines.log.recording import filenames
from pipelines.log.recording.recipe import LogSpec
from pipelines.log.recording.recordings import Assembled, Material, Source
from pipelines.log.robot import format_robot

__all__ = ["SourceFile", "make_log"]


@dataclass(frozen=True)
class SourceFile:
    """A recorded file, and the columns taken from it."""

    name: str
    sha256: str
    columns: tuple[str, ...]


def make_log(source: Source, material: Material, assembled: Assembled, t: Array, signals: Mapping[str, Signal],
             steps: tuple[str, ...],
             altered: tuple[str, ...], number: int | None) -> tuple[ExperimentLog, tuple[SourceFile, ...]]:
    """One log of converted signals, and the files it came from.

    Raises:
        InputRejected: T07 shorter than a period, T08 hardly a sample, S01 an frf log without excitation.
        UsageError: C02, name, experiment, role or joint cannot be told from the recipe and the file's name.
    """
    recipe, robot = material.recipe, material.robot
    about = _about(recipe.log, source, recipe.where)
    name = (clean(filenames.fill(about.name, source.groups, recipe.where), 200) or "log") + (f"-{number}" if number else "")
    files = tuple(SourceFile(file, table.sha256,
                             tuple(c for columns in assembled.columns.values() for c in columns if c in table.columns))
                  for file, table in source.tables.items())
    step = 1.0 / recipe.resample.rate if recipe.resample else float(np.median(np.diff(t))) if recipe.time.column is not None else \
        recipe.time.sample_time or 1.0 / (recipe.time.rate or 1.0)
    duration = float(t[-1] - t[0])
    if t.size < 11:
        raise InputRejected("T08", f"{t.size} samples at {1 / step:g} Hz", where=source.primary,
                            remedy="record longer, or resample faster")
    if about.period is not None and duration < about.period * (1.0 - 1e-6):
        raise InputRejected("T07", f"{duration:.4g} s < {about.period:g} s period", where=source.primary,
                            remedy="record a whole period, or correct period")
    if about.experiment == "frf" and "v" not in signals:
        raise InputRejected("S01", "an frf log without its excitation v", where=source.primary, remedy="map signals.v")
    ordered = {"t": Signal(t, "s", schema.SIGNALS["t"][1])} | {key: signals[key] for key in schema.SIGNALS if key in signals}
    log = ExperimentLog(
        name=name, experiment=about.experiment, role=about.role, origin=about.origin, torque=about.torque, robot_name=robot.name,
        sample_time=step,
        robot_text=format_robot(robot), signals=ordered, recorded=about.recorded, joint=about.joint, period=about.period,
        posture=None if about.posture is None else np.array(about.posture), controller=_controller(material),
        derived=_derived(files, material, steps, altered, about.recorded) if altered else None)
    return log, files


def _about(base: LogSpec, source: Source, where: str) -> LogSpec:
    """[log], overruled by the groups of the file's name, overruled by its [[file]] case."""
    groups = source.groups
    found: dict[str, Any] = {}
    for key, known in (("experiment", schema.EXPERIMENTS), ("role", schema.ROLES)):
        if key in groups:
            if groups[key] not in known:
                raise UsageError("C02", f"'{source.primary}' gives {key} '{groups[key]}', must be one of {', '.join(known)}",
                                 where=where)
            found[key] = groups[key]
    if "joint" in groups:
        if not groups["joint"].isdigit():
            raise UsageError("C02", f"'{source.primary}' gives joint '{groups['joint']}', must be a number", where=where)
        found["joint"] = int(groups["joint"])
    if source.case is not None:
        keys = ("name", "experiment", "role", "joint", "period", "recorded", "posture")
        found |= {key: value for key in keys if (value := getattr(source.case, key)) is not None}
    about = replace(base, **found)
    if about.experiment not in schema.ONE_JOINT:
        return replace(about, joint=None)
    if about.joint is None:
        raise UsageError("C02", f"{about.experiment} log '{source.primary}' without its joint", where=where,
                         remedy="write joint = … in its [[file]], or {joint} in the pattern")
    return about


def _controller(material: Material) -> Controller | None:
    spec = material.recipe.controller
    if spec is None:
        return None
    arrays: dict[str, Any] = {key: np.array(value) for key in ("kp", "kd", "ki", "output_limit", "torque_resolution")
                              if (value := getattr(spec, key)) is not None}
    return Controller(law=spec.law, feedforward=spec.feedforward, velocity=spec.velocity, delay=spec.delay, **arrays)


def _derived(files: tuple[SourceFile, ...], material: Material, steps: tuple[str, ...], altered: tuple[str, ...],
             recorded: str | None) -> Derived:
    record = {"recipe": material.recipe_path.name, "files": {file.name: file.sha256 for file in files}, "converted": list(steps),
              "altered": list(altered)}
    sha256 = files[0].sha256 if len(files) == 1 else hashlib.sha256("\n".join(file.sha256 for file in files).encode()).hexdigest()
    return Derived("import", json.dumps(record, sort_keys=True), sha256, created(recorded))
