"""Hold items against a model that is known: only what goes beyond it, and beyond the uncertainty of both, is something found.

A cause that the baseline has as an effect at the same joint is accepted, as long as its parameters are the same within 3 std of
the difference; so are base parameters and friction. A single number is beyond that by chance once in 370 times; with many, the
limit is raised so that of all numbers of an item together one is beyond it as rarely (Šidák 1967).
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pipelines.batch.drift import LIMIT
from pipelines.batch.parts import Part, place_of
from pipelines.batch.record import Record
from pipelines.errors import Check, clean
from pipelines.fit.differences import difference
from pipelines.io.model_file import ModelFile, StoredEffect, StoredValue
from pipelines.model.effects import effect_names, find_effect
from pipelines.model.effects.kinds import FrictionLaw
from pipelines.model.parameter_names import quantity_of
from pipelines.report.result_figures import name_in
from pipelines.report.style import format_number, unit_in_words
from pipelines.report.words import figure_in_words, title_of

__all__ = ["against", "known_figures", "unheld"]

_LAW = re.compile(r"\b(?P<law>[a-z_]+)(?::(?P<at>\d+):| joint (?P<joint>\d+) )")  # "coulomb:3:level", "coulomb joint 3 level"


def against(record: Record, baseline: ModelFile) -> Record:
    """`record` as it stands with the baseline in mind: "ok" where it holds nothing new, "found" with the changes where it does.

    What is wrong beside named causes no baseline explains: the record's words stand before the changes.
    What is of another robot than the baseline's is not judged by it.
    """
    part = record.part
    if record.status not in ("ok", "found") or part is None or _robot(baseline) not in ("", part.robot):
        return record
    gone, remarks = _gone(part, baseline)
    changes = [*_moved(part, baseline), *_new_causes(part, baseline), *gone]
    explained = record.status == "ok" or record.accepts
    if changes:
        told = _limited("Beyond the baseline", [*changes, *remarks])
        return dataclasses.replace(record, status="found", verdict=told if explained else f"{record.verdict} {told}".strip())
    more = f" {_limited('Of the baseline', remarks)}" if remarks else ""
    before = "Nothing beyond the baseline. " if explained and record.status == "found" else ""
    return dataclasses.replace(record, status="ok" if explained else "found", verdict=f"{before}{record.verdict}{more}")


def _limited(about: str, words: Sequence[str]) -> str:
    return clean(f"{about}: {'; '.join(words)}.", None)


def unheld(stage: str, records: Iterable[Record], baseline: ModelFile, sharded: bool = False) -> tuple[Check, ...]:
    """What of the baseline no item of `stage` can be held against: that nothing is said of it does not mean that it is the same.

    Where that is all of it, the check is a gate: what was asked for has not been done. Of a batch in shards another one may
    have the items of the baseline's robot: laid together, they are asked again.
    """
    done = [(record.name, part) for record in records
            if record.status in ("ok", "found") and (part := record.part) is not None]
    strange = [name for name, part in done if _robot(baseline) not in ("", part.robot)]
    judged = [part for _, part in done if _robot(baseline) in ("", part.robot)]
    if not judged:
        what, remedy = ("item of this shard", "lay the shards together, and judge them with --resume") if sharded else (
            "item", "give a model of this robot")
        return (_warned(f"the baseline is of {_robot(baseline)}, and no {what} is: nothing is held against it", remedy,
                        gate=not sharded),) if done else ()
    said = []
    if strange:
        said.append(_warned(f"{len(strange)} of {len(done)} items are of another robot than the baseline, and not held against it: "
                            f"{', '.join(strange[:3])}", "give the folders of each robot a batch of their own"))
    said += _other_laws(stage, judged, baseline)
    missing = [name for name, part in _kinds(baseline).items() if not _met(part, judged)]
    nothing = not any(part.diagnosed or known_figures(baseline, part.figures) for part in judged)
    if missing:
        said.append(_warned(f"of the baseline, {_listed(missing)} met nothing to be held against: {stage} names none of them",
                            "run 'rrrid batch' with --stage run, and with the friction laws of the baseline", gate=nothing))
    elif nothing:
        said.append(_warned(f"the baseline has no number with an uncertainty, and {stage} names no causes: nothing is held to it",
                            "give a model.json that a command has fitted", gate=True))
    return tuple(said)


def _other_laws(stage: str, judged: Sequence[Part], baseline: ModelFile) -> Iterator[Check]:
    """Joints whose friction is not held against the baseline, for one of the two has a law more."""
    for laws_of, words, remedy in (
            (_laws_apart, f"it has {{}}, and {stage} fits none",
             "run 'rrrid batch' with --stage run, or give a model of the same laws"),
            (_laws_beside, f"{stage} fits {{}}, and it has none", "give a model of the same laws")):
        found = sorted({place for part in judged for place in laws_of(part, baseline)})
        if found:
            joints, laws = sorted({str(joint) for joint, _ in found}), dict.fromkeys(title_of(law) for _, law in found)
            yield _warned(f"of the baseline, the friction of joint {_listed(joints)} follows other laws: "
                          f"{words.format(_listed(list(laws)))}", remedy)


def _kinds(baseline: ModelFile) -> dict[str, ModelFile]:
    return {"base parameters": dataclasses.replace(baseline, friction=(), effects=()),
            "friction": dataclasses.replace(baseline, base_parameters=(), effects=()),
            "effects": dataclasses.replace(baseline, base_parameters=(), friction=())}


def _met(kind: ModelFile, judged: Iterable[Part]) -> bool:
    """Return whether there was something to hold what there is of `kind` against: an effect is met by what names causes as well."""
    asked = kind.effects or _spelled(kind)
    return not asked or any(known_figures(kind, part.figures) or (kind.effects and part.diagnosed) for part in judged)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _warned(message: str, remedy: str, gate: bool = False) -> Check:
    return Check.of("C06", "warn", message, where="--baseline", remedy=remedy, gate=gate)


def _robot(baseline: ModelFile) -> str:
    """The name of the robot that the baseline is of; empty where it says none."""
    return name_in(baseline.robot)


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


def _moved(part: Part, baseline: ModelFile) -> Iterator[str]:
    """The figures beyond the baseline's, in words."""
    # The causes that were found are held against the baseline one by one, below.
    found = [f"{finding['cause']} joint {finding['joint']} " for finding in part.findings]
    apart = {joint for joint, _ in (*_laws_apart(part, baseline), *_laws_beside(part, baseline))}
    strange = [one for one in baseline.friction if one.joint in apart]
    known = {name: figure for name, figure in known_figures(baseline, part.figures).items()
             if not any(cause in name for cause in found) and not any(_is_of(name, one) for one in strange)}
    limit = _limit(len(known))
    for name, (value, std) in known.items():
        new, own, unit = part.figures[name]
        away = _change(name, new, value) / math.hypot(own, std)
        if abs(away) > limit:
            far = f"{'+' if away > 0.0 else '−'}{format_number(abs(away), 2)} std"
            yield f"{figure_in_words(name)} {_told(new, unit)}, {format_number(value)} before ({far})"


def _laws_apart(part: Part, baseline: ModelFile) -> list[tuple[int, str]]:
    """(joint, law) of the baseline's friction that a part lacks where it has other laws of that joint.

    A Coulomb level beside Stribeck friction is not the one without: the two are not held against each other.
    """
    fitted = known_figures(dataclasses.replace(baseline, base_parameters=(), effects=()), part.figures)
    found = list[tuple[int, str]]()
    for joint in sorted({one.joint for one in baseline.friction if one.joint is not None}):
        own = [one for one in baseline.friction if one.joint == joint and any(p.std for p in one.parameters.values())]
        there = {one.effect for one in own if any(_is_of(name, one) for name in fitted)}
        found += [(joint, one.effect) for one in own if there and one.effect not in there]
    return found


def _laws_beside(part: Part, baseline: ModelFile) -> list[tuple[int, str]]:
    """(joint, law) that a part has fitted together with friction of the baseline, and that the baseline does not have there.

    One that a diagnosis has found is new, and is told as that.
    """
    known = {(one.effect, one.joint) for one in (*baseline.friction, *baseline.effects)}
    known |= {(str(finding["cause"]), finding["joint"]) for finding in part.findings}
    laws = {name: law for name in part.figures if (law := _law_of(name)) is not None}
    held = known_figures(dataclasses.replace(baseline, base_parameters=(), effects=()), part.figures)
    # What another stage has fitted is another model: a level is that beside the laws of its own.
    together = {(laws[name][0], laws[name][2]) for name in held if name in laws}
    return sorted({(joint, law) for before, law, joint in laws.values()
                   if (before, joint) in together and (law, joint) not in known})


def _law_of(name: str) -> tuple[str, str, int] | None:
    """(the stage before it, friction law, joint) of a figure of one, however results spell it."""
    found = _LAW.search(name)
    if found is None or found["law"] not in effect_names() or not issubclass(find_effect(found["law"]), FrictionLaw):
        return None
    return name[:found.start()], found["law"], int(found["at"] or found["joint"])


def _is_of(name: str, one: StoredEffect) -> bool:
    """Return whether a figure is one of an effect at its place, however results spell it."""
    return any(f" {begun}" in f" {name}" for begun in (f"{one.effect}:{one.joint}:", f"{one.effect} joint {one.joint} "))


def _change(name: str, new: float, old: float) -> float:
    """How far a figure moved; a phase comes back to where it was after a whole turn."""
    kind = quantity_of(name)
    return difference(old, new, None if kind is None else kind.period)


def _limit(numbers: int) -> float:
    """[std] that all of `numbers` normal ones stay within as often as a single one stays within `LIMIT`."""
    from statistics import NormalDist

    if numbers < 2:
        return LIMIT
    single = 2.0 * NormalDist().cdf(-LIMIT)
    return -NormalDist().inv_cdf(-math.expm1(math.log1p(-single) / numbers) / 2.0)


def _new_causes(part: Part, baseline: ModelFile) -> Iterator[str]:
    """The causes that a diagnosis names and the baseline does not have, or has otherwise."""
    for finding in part.findings:
        cause, joint = str(finding["cause"]), finding["joint"]
        place = place_of(finding)
        known = next((one for one in (*baseline.effects, *baseline.friction) if (one.effect, one.joint) == (cause, joint)), None)
        if known is None:
            yield f"{place}, which it does not have"
        else:
            yield from _otherwise(place, finding["parameters"] or {}, known)


def _gone(part: Part, baseline: ModelFile) -> tuple[list[str], list[str]]:
    """The effects of the baseline that a diagnosis does not name any more: those it would have found, and those it might not have.

    What the reference logs show as well is no finding, and there all the same. An effect is gone where it is larger than the
    least that these logs would show by more than its own uncertainty explains. One that the baseline itself cannot tell from
    nothing, an offset that was fitted with the rest, is not missed. A diagnosis of something without a name tells no causes
    apart, nor does one of logs that cannot be judged: of none it says that it is gone.
    """
    gone, unsure = list[str](), list[str]()
    untold = {"unknown": "something is wrong that has no name", "cannot-judge": "these logs cannot be judged"}.get(part.verdict)
    there = {*map(place_of, part.findings), *part.baseline_effects}
    for one in baseline.effects if part.diagnosed else ():
        place = place_of({"cause": one.effect, "joint": one.joint})
        parameter, least = part.detection_limits.get(place, ("", math.inf))
        stored = one.parameters.get(parameter)
        if place in there or not any(map(_is_there, one.parameters.values() if stored is None else (stored,))):
            continue
        if untold:
            unsure.append(f"{place} is not found, and might be there: {untold}")
        elif stored is not None and abs(stored.value) - LIMIT * (stored.std or 0.0) > least:
            gone.append(f"{place} is not found any more: {parameter} {_told(stored.value, stored.unit)} before, and from "
                        f"{_told(least, stored.unit, 2)} on it would have been")
        else:
            unsure.append(f"{place} is not found, and might be there: these logs would not show it for sure")
    return gone, unsure


def _is_there(stored: StoredValue) -> bool:
    return stored.std is None or abs(stored.value) > LIMIT * stored.std


def _otherwise(place: str, parameters: Mapping[str, Any], known: StoredEffect) -> Iterator[str]:
    """The parameters of a known cause that are no longer what they were."""
    shared = [(name, stored) for name, stored in known.parameters.items() if _single(parameters.get(name))]
    limit = _limit(len(shared))
    for name, stored in shared:
        new = parameters[name]
        std = math.hypot(new["std"] or 0.0, stored.std or 0.0)
        change = _change(f"{place}:{name}", new["value"], stored.value)
        if abs(change) > limit * std:
            yield f"{place} {name} {_told(new['value'], new['unit'])}, {format_number(stored.value)} before"


def _told(value: float, unit: str, digits: int = 4) -> str:
    return f"{format_number(value, digits)} {unit_in_words(unit)}".strip()


def _single(value: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(value.get("value"), int | float) and not isinstance(value.get("std"), list)
