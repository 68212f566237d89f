"""Make one log of signals in SI: what the recipe, the file's name and its `[[file]]` case say of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, UsageError, clean
from pipelines.log import schema
from pipelines.log.derive import created
from pipelines.log.experiment import Array, Controller, Derived, ExperimentLog, Signal
from pipelines.log.limits import FEWEST, recorded_span, shorter_than_period
from pipelines.log.recording import filenames
from pipelines.log.recording.recipe import LogSpec, Recipe
from pipelines.log.recording.recordings import Assembled, Material, Source
from pipelines.log.robot import format_robot

__all__ = ["SourceFile", "make_log"]


@dataclass(frozen=True)
class SourceFile:
    """A recorded file, and the columns taken from it."""

    name: str
    sha256: str
    columns: tuple[str, ...]


def make_log(
    source: Source,
    material: Material,
    assembled: Assembled,
    t: Array,
    signals: Mapping[str, Signal],
    steps: tuple[str, ...],
    altered: tuple[str, ...],
    number: int | None,
) -> tuple[ExperimentLog, tuple[SourceFile, ...], tuple[str, ...]]:
    """One log of converted signals, the files it came from, and `altered` with what was done here as well.

    Raises:
        InputRejected: T07 shorter than a period, T08 hardly a sample, S01 an frf log without excitation.
        UsageError: C02, name, experiment, role or joint cannot be told from the recipe and the file's name.
    """
    recipe, robot = material.recipe, material.robot
    about = _about(recipe.log, source, recipe.where)
    name = (clean(filenames.fill(about.name, source.groups, recipe.where), 200) or "log") + (
        f"-{number}" if number else ""
    )
    files = tuple(
        SourceFile(
            file,
            table.sha256,
            tuple(
                c for columns in assembled.columns.values() for c in columns if c in table.columns
            ),
        )
        for file, table in source.tables.items()
    )
    step = _sample_time(recipe, t)
    if t.size < FEWEST:
        message = f"{t.size} samples at {1 / step:g} Hz; a log needs {FEWEST}"
        remedy = "record longer, or resample faster"
        raise InputRejected("T08", message, where=source.primary, remedy=remedy)
    if about.period is not None and shorter_than_period(t, step, about.period):
        short = f"{recorded_span(t, step):.4g} s < {about.period:g} s period"
        if number is None:
            remedy = "record a whole period, or correct period"
            raise InputRejected("T07", short, where=source.primary, remedy=remedy)
        # A part of a log that had to be split need not hold a whole period; it is then a log without one.
        about, altered = replace(about, period=None), (*altered, f"period left out: {short}")
    if about.experiment == "frf" and "v" not in signals:
        message = "an frf log without its excitation v"
        raise InputRejected("S01", message, where=source.primary, remedy="map signals.v")
    ordered = {"t": Signal(t, "s", schema.SIGNALS["t"][1])} | {
        key: signals[key] for key in schema.SIGNALS if key in signals
    }
    log = ExperimentLog(
        name=name,
        experiment=about.experiment,
        role=about.role,
        origin=about.origin,
        torque=about.torque,
        robot_name=robot.name,
        sample_time=step,
        robot_text=format_robot(robot),
        signals=ordered,
        recorded=about.recorded,
        joint=about.joint,
        period=about.period,
        posture=None if about.posture is None else np.array(about.posture),
        controller=_controller(material),
        derived=_derived(files, material, steps, altered, about.recorded) if altered else None,
    )
    return log, files, altered


def _sample_time(recipe: Recipe, t: Array) -> float:
    if recipe.resample:
        return 1.0 / recipe.resample.rate
    if recipe.time.column is not None:
        return float(np.median(np.diff(t)))
    return recipe.time.sample_time or 1.0 / (recipe.time.rate or 1.0)


def _about(base: LogSpec, source: Source, where: str) -> LogSpec:
    """[log], overruled by the groups of the file's name, overruled by its [[file]] case."""
    groups = source.groups
    found: dict[str, Any] = {}
    for key, known in (("experiment", schema.EXPERIMENTS), ("role", schema.ROLES)):
        if key in groups:
            if groups[key] not in known:
                message = f"'{source.primary}' gives {key} '{groups[key]}', must be one of {', '.join(known)}"
                remedy = f"rename the file, or write {key} = … in a [[file]] case before it"
                raise UsageError("C02", message, where=where, remedy=remedy)
            found[key] = groups[key]
    if "joint" in groups:
        if not groups["joint"].isdigit():
            message = f"'{source.primary}' gives joint '{groups['joint']}', must be a number"
            remedy = "rename the file, or take digits alone: {joint:[0-9]+}"
            raise UsageError("C02", message, where=where, remedy=remedy)
        found["joint"] = int(groups["joint"])
    if source.case is not None:
        keys = ("name", "experiment", "role", "joint", "period", "recorded", "posture")
        found |= {key: value for key in keys if (value := getattr(source.case, key)) is not None}
    about = replace(base, **found)
    if about.experiment not in schema.ONE_JOINT:
        return replace(about, joint=None)
    if about.joint is None:
        message = f"{about.experiment} log '{source.primary}' without its joint"
        remedy = "write joint = … in its [[file]], or {joint} in the pattern"
        raise UsageError("C02", message, where=where, remedy=remedy)
    return about


def _controller(material: Material) -> Controller | None:
    spec = material.recipe.controller
    if spec is None:
        return None
    arrays: dict[str, Any] = {
        key: np.array(value)
        for key in ("kp", "kd", "ki", "output_limit", "torque_resolution")
        if (value := getattr(spec, key)) is not None
    }
    return Controller(
        law=spec.law,
        feedforward=spec.feedforward,
        velocity=spec.velocity,
        delay=spec.delay,
        **arrays,
    )


def _derived(
    files: tuple[SourceFile, ...],
    material: Material,
    steps: tuple[str, ...],
    altered: tuple[str, ...],
    recorded: str | None,
) -> Derived:
    # `created` is the time of the recording where the recipe gives it. Where it does not, no honest time is left: the
    # clock on the wall and the times of files differ from one import to the next, and equal inputs give equal bytes. It is
    # then SOURCE_DATE_EPOCH, by default 1970-01-01T00:00:00Z: to be read as "not known". provenance.json has the hour.
    record = {
        "recipe": material.recipe_path.name,
        "files": {file.name: file.sha256 for file in files},
        "converted": list(steps),
        "altered": list(altered),
    }
    sha256 = (
        files[0].sha256
        if len(files) == 1
        else hashlib.sha256("\n".join(file.sha256 for file in files).encode()).hexdigest()
    )
    return Derived("import", json.dumps(record, sort_keys=True), sha256, created(recorded))
