"""Hold items against a model that is known: only what goes beyond it, and beyond the uncertainty of both, is something found.

A cause that the baseline has as an effect at the same joint is accepted, as long as its parameters are the same within 3 std of
the difference; so are base parameters and friction. A single number is beyond that by chance once in 370 times; with many, the
limit is raised so that of all numbers of an item together one is beyond it as rarely (Šidák 1967).
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from pipelines.batch.drift import LIMIT
from pipelines.batch.record import Record
from pipelines.errors import clean
from pipelines.log.model_file import ModelFile, StoredEffect

__all__ = ["against", "known_figures"]


def against(record: Record, baseline: ModelFile) -> Record:
    """`record` as it stands with the baseline in mind: "ok" where it holds nothing new, "found" with the changes where it does.

    An item of another robot than the baseline's is not judged by it.
    """
    if record.status not in ("ok", "found") or _robot(baseline) not in ("", record.robot):
        return record
    changes = [*_moved(record, baseline), *_new_causes(record, baseline)]
    accepted = record.status == "ok" or record.accepts
    if changes:
        return dataclasses.replace(record, status="found", verdict=clean("Beyond the baseline: " + "; ".join(changes) + ".", 1000))
    if accepted and record.status == "found":
        return dataclasses.replace(record, status="ok", verdict=f"Nothing beyond the baseline. {record.verdict}")
    return record


def _robot(baseline: ModelFile) -> str:
    """The name of the robot that the baseline is of; empty where it says none."""
    return str(tomllib.loads(baseline.robot).get("name", ""))


def known_figures(baseline: ModelFile) -> dict[str, tuple[float, float]]:
    """Name of a figure, as records have it -> (value, std) of the baseline."""
    known = {p.name: (p.value, p.std) for p in baseline.base_parameters if p.std is not None and p.visible}
    for effect in (*baseline.friction, *baseline.effects):
        for name, stored in effect.parameters.items():
            if stored.std is not None:
                known[_figure(effect.effect, effect.joint, name)] = (stored.value, stored.std)
    return known


def _figure(effect: str, joint: int | None, parameter: str) -> str:
    place = "" if joint is None else f"{joint}:"
    return f"{effect}:{place}{parameter}"


def _moved(record: Record, baseline: ModelFile) -> Iterator[str]:
    """The figures beyond the baseline's, in words."""
    known = known_figures(baseline)
    # Of a run's stages the last one counts: what `extend` fitted has the causes in it, which those before it lack.
    last = {place: name for name in record.figures if (place := _place(name, known)) is not None}
    shared = [(name, *known[place]) for place, name in last.items()]
    limit = _limit(len(shared))
    for name, value, std in shared:
        new, own, unit = record.figures[name]
        away = (new - value) / math.hypot(own, std)
        if abs(away) > limit:
            yield f"{name} {new:.4g} {unit}, {value:.4g} before ({away:+.1f} std)"


def _place(name: str, known: Mapping[str, Any]) -> str | None:
    """The baseline's name for a record's figure: of a run, the stage's name stands before it."""
    return next((place for place in (name, name.rpartition(" ")[2]) if place in known), None)


def _limit(numbers: int) -> float:
    """[std] that all of `numbers` normal ones stay within as often as a single one stays within `LIMIT`."""
    from statistics import NormalDist

    if numbers < 2:
        return LIMIT
    single = 2.0 * NormalDist().cdf(-LIMIT)
    return -NormalDist().inv_cdf(-math.expm1(math.log1p(-single) / numbers) / 2.0)


def _new_causes(record: Record, baseline: ModelFile) -> Iterator[str]:
    """The causes that a diagnosis names and the baseline does not have, or has otherwise."""
    for finding in record.findings:
        cause, joint = str(finding["cause"]), finding["joint"]
        place = cause if joint is None else f"{cause}:{joint}"
        known = next((one for one in (*baseline.effects, *baseline.friction) if (one.effect, one.joint) == (cause, joint)), None)
        if known is None:
            yield f"{place}, which it does not have"
        else:
            yield from _otherwise(place, finding["parameters"] or {}, known)


def _otherwise(place: str, parameters: Mapping[str, Any], known: StoredEffect) -> Iterator[str]:
    """The parameters of a known cause that are no longer what they were."""
    shared = [(name, stored) for name, stored in known.parameters.items() if _single(parameters.get(name))]
    limit = _limit(len(shared))
    for name, stored in shared:
        new = parameters[name]
        std = math.hypot(new["std"] or 0.0, stored.std or 0.0)
        change = new["value"] - stored.value
        if abs(change) > limit * std:
            yield f"{place} {name} {new['value']:.4g} {new['unit']}, {stored.value:.4g} before"


def _single(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("value"), int | float) and not isinstance(value.get("std"), list)
