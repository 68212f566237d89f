"""Hold items against a model that is known: only what goes beyond it, and beyond the uncertainty of both, is something found.

A cause that the baseline has as an effect at the same joint is accepted, as long as its parameters are the same within 3 std of
the difference; so are base parameters and friction. A single number is beyond that by chance once in 370 times; with many, the
limit is raised so that of all numbers of an item together one is beyond it as rarely (Šidák 1967).
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pipelines.batch.drift import LIMIT
from pipelines.batch.record import Record
from pipelines.errors import Check, clean
from pipelines.log.model_file import ModelFile, StoredEffect

__all__ = ["against", "known_figures", "unheld"]


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


def unheld(stage: str, records: Iterable[Record], baseline: ModelFile) -> tuple[Check, ...]:
    """What of the baseline no item of `stage` can be held against: that nothing is said of it does not mean that it is the same.

    Where that is all of it, the check is a gate: what was asked for has not been done.
    """
    done = [record for record in records if record.status in ("ok", "found")]
    others = [record.name for record in done if _robot(baseline) not in ("", record.robot)]
    judged = [record for record in done if record.name not in set(others)]
    if not judged:
        return (_warned(f"the baseline is of {_robot(baseline)}, and no item is: nothing is held against it",
                        "give a model of this robot", gate=True),) if done else ()
    said = []
    if others:
        said.append(_warned(f"{len(others)} of {len(done)} items are of another robot than the baseline, and not held against it: "
                            f"{', '.join(others[:3])}", "give the folders of each robot a batch of their own"))
    missing = [name for name, part in _parts(baseline).items() if not _met(part, judged)]
    nothing = not any(record.diagnosed or known_figures(baseline, record.figures) for record in judged)
    if missing:
        said.append(_warned(f"of the baseline, {_listed(missing)} met nothing to be held against: {stage} names none of them",
                            "run 'rrrid batch' with --stage run, and with the friction laws of the baseline", gate=nothing))
    elif nothing:
        said.append(_warned(f"the baseline has no number with an uncertainty, and {stage} names no causes: nothing is held to it",
                            "give a model.json that a command has fitted", gate=True))
    return tuple(said)


def _parts(baseline: ModelFile) -> dict[str, ModelFile]:
    return {"base parameters": dataclasses.replace(baseline, friction=(), effects=()),
            "friction": dataclasses.replace(baseline, base_parameters=(), effects=()),
            "effects": dataclasses.replace(baseline, base_parameters=(), friction=())}


def _met(part: ModelFile, judged: Iterable[Record]) -> bool:
    """Whether there was something to hold what there is of `part` against: an effect is met by what names causes as well."""
    asked = part.effects or _spelled(part)
    return not asked or any(known_figures(part, record.figures) or (part.effects and record.diagnosed) for record in judged)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _warned(message: str, remedy: str, gate: bool = False) -> Check:
    return Check.of("C06", "warn", message, where="--baseline", remedy=remedy, gate=gate)


def _robot(baseline: ModelFile) -> str:
    """The name of the robot that the baseline is of; empty where it says none."""
    return str(tomllib.loads(baseline.robot).get("name", ""))


def known_figures(baseline: ModelFile, names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Those of `names`, which are of figures as records have them, that the baseline knows -> its (value, std).

    Of a run, which has a figure from stage after stage, the last one counts: what `extend` fitted has the causes in it, which
    those before it lack.
    """
    known = _spelled(baseline)
    last: dict[int, tuple[str, tuple[float, float]]] = {}
    for name in names:
        words = name.split(" ")
        place = next((known[end] for k in range(len(words)) if (end := " ".join(words[k:])) in known), None)
        if place is not None:
            last[place[0]] = name, place[1]
    return dict(last.values())


def _spelled(baseline: ModelFile) -> dict[str, tuple[int, tuple[float, float]]]:
    """Every way in which results name a figure of the baseline, before which the stage may stand -> its number, (value, std)."""
    known = {p.name: (i, (p.value, p.std)) for i, p in enumerate(baseline.base_parameters) if p.std is not None and p.visible}
    number = len(baseline.base_parameters)
    for effect in (*baseline.friction, *baseline.effects):
        for name, stored in effect.parameters.items():
            number += 1
            if stored.std is not None:
                beside = "" if effect.joint is None else f"{effect.joint}:"
                in_words = "" if effect.joint is None else f"joint {effect.joint} "
                for spelling in (f"{effect.effect}:{beside}{name}", f"{effect.effect} {in_words}{name.replace('_', ' ')}"):
                    known[spelling] = number, (stored.value, stored.std)
    return known


def _moved(record: Record, baseline: ModelFile) -> Iterator[str]:
    """The figures beyond the baseline's, in words."""
    # The causes that were found are held against the baseline one by one, below.
    found = [f"{finding['cause']} joint {finding['joint']} " for finding in record.findings]
    known = {name: figure for name, figure in known_figures(baseline, record.figures).items()
             if not any(cause in name for cause in found)}
    limit = _limit(len(known))
    for name, (value, std) in known.items():
        new, own, unit = record.figures[name]
        away = _change(name, unit, new, value) / math.hypot(own, std)
        if abs(away) > limit:
            yield f"{name} {new:.4g} {unit}, {value:.4g} before ({away:+.1f} std)"


def _change(name: str, unit: str, new: float, old: float) -> float:
    """How far a figure moved; a phase comes back to where it was after a whole turn."""
    return math.remainder(new - old, 2.0 * math.pi) if unit == "rad" and "phase" in name else new - old


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
        change = _change(name, new["unit"], new["value"], stored.value)
        if abs(change) > limit * std:
            yield f"{place} {name} {new['value']:.4g} {new['unit']}, {stored.value:.4g} before"


def _single(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("value"), int | float) and not isinstance(value.get("std"), list)
