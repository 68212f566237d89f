"""Take out of a stage's result the fitted figures with their std, and the residuals.

A figure is what has `value`, `std` and `unit`; a residual is what bears one of a few names. Each
gets a name in words from where it is: "p1", "joint 2 viscous", "cogging joint 2 amplitude",
"nominal model residual rms", "extended model residual rms". A model that was fitted has the numbers
of a finding again: a comparison passes the findings over that both models hold.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any, Final

from pipelines.io.results import StoredResult
from pipelines.io.sandbox import TomlError, parse_toml

__all__ = ["called", "fitted", "modelled", "numbers_of", "residuals", "robot_of"]

Place = tuple[str, int | None]  # cause; joint, from 1

# What a result calls the error that is left, its words, and its unit; arrays are per joint.
_RESIDUALS: Final = {
    "torque_rms": ("torque rms", "N m"),
    "residual_rms": ("nominal model residual rms", "N m"),
    "after_rms": ("extended model residual rms", "N m"),
    "relative_error": ("relative error", "1"),
    "reconstruction_error_max": ("reconstruction error max", "rad"),
}
_SAID_BEFORE: Final = {"after_rms": "noise_floor"}  # the nominal model has it already
_SLIDING: Final = {"N m": "N", "rad": "m"}  # of a joint that slides
# Fields that name one of a list; containers without a name; what the stage itself judges.
_NAMING: Final = ("name", "label", "effect", "cause", "kind", "law", "joint", "posture", "method")
_SILENT: Final = ("parameters", "result", "torque")
_PASSED_OVER: Final = (
    "comparison",
    "candidate_laws",
    "rejected",
    "detection_limits",
    "courses",
    "previews",
)
_FINDINGS: Final = ("findings", "baseline_effects")


def called(a: StoredResult, b: StoredResult) -> tuple[str, str]:
    """Return the names of the two: as much of their paths, from the end, as differs."""
    files = [one.path.parent if one.path.name == "result.json" else one.path for one in (a, b)]
    for depth in range(1, 5):
        names = ["/".join(file.parts[-depth:]) for file in files]
        if names[0] != names[1]:
            return names[0], names[1]
    return f"{files[0].name} (A)", f"{files[1].name} (B)"


def modelled(result: Mapping[str, Any]) -> frozenset[Place]:
    """Every law and effect of every model in `result`: a stage's, a run's, or a model file's.

    Raises:
        KeyError, TypeError, AttributeError: it is no result.
    """
    kinds = ("friction", "effects") if "base_parameters" in result else ()
    found = {(str(one["effect"]), one["joint"]) for kind in kinds for one in result[kind]}
    below = [result["model"]] if isinstance(result.get("model"), Mapping) else []
    below += [step.get("result") or {} for step in result.get("stages") or ()]
    return frozenset(found.union(*map(modelled, below)))


def fitted(
    result: Mapping[str, Any], held: Container[Place] = (), most: int = 400
) -> dict[str, tuple[float, float, str]]:
    """Name -> (value, std, unit) of every figure of `result` whose std is known.

    Args:
        held: findings that are passed over.
    """
    found: dict[str, tuple[float, float, str]] = {}
    for name, holder in _figures(result, held):
        value, std = holder["value"], holder["std"]
        if _number(value) and _number(std) and std > 0.0 and len(found) < most:
            found[_free(name, found)] = (float(value), float(std), str(holder["unit"]))
    return found


def numbers_of(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the name of every figure of `result`, with a std or without."""
    return tuple(dict.fromkeys(name for name, _ in _figures(result)))


def _figures(
    result: Mapping[str, Any], held: Container[Place] = ()
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, holder in _walk(_single(result), (), held):
        if {"value", "std", "unit"} <= set(holder):
            yield name, holder


def residuals(
    result: Mapping[str, Any], turning: Sequence[bool] = (), most: int = 400
) -> dict[str, tuple[float, str]]:
    """Name -> (value, unit) of every residual of `result`.

    Args:
        turning: which joints turn, of a known robot; else what the units of the result say.
    """
    found: dict[str, tuple[float, str]] = {}
    slides = {j + 1 for j, turns in enumerate(turning) if not turns} or _sliding(result)
    for name, holder in _walk(_single(result)):
        for key in filter(holder.__contains__, _RESIDUALS):
            words, unit = _RESIDUALS[key]
            for place, joint, value in _leaves(holder[key], but=_SAID_BEFORE.get(key)):
                if len(found) < most:
                    full = _free(" ".join(filter(None, (name, words, place))), found)
                    found[full] = (value, _SLIDING.get(unit, unit) if joint in slides else unit)
    return found


def _sliding(result: Mapping[str, Any]) -> set[int]:
    """Return the joints, from 1, that slide by the units of a result."""
    return {
        joint
        for _, holder in _walk(_single(result))
        for key in ("units", "torque_units")
        if isinstance(holder.get(key), list)
        for joint, unit in enumerate(holder[key], 1)
        if unit in _SLIDING.values()
    }


def robot_of(result: Any) -> str:
    """Return the name of the first robot that a result is of; "" where it says none."""
    items = result if isinstance(result, list) else []
    if isinstance(result, Mapping):
        robot = result.get("robot")
        if isinstance(robot, str):
            return _name_in(robot) if "base_parameters" in result else robot
        items = [item for key, item in result.items() if key != "model"]
    return next(filter(None, map(robot_of, items)), "")


def _name_in(robot: str) -> str:
    """Return the name in a robot description, "" without one."""
    try:
        return str(parse_toml(robot).get("name", ""))
    except TomlError:
        return ""


def _single(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the stages of a run alone: all else in its result repeats them."""
    return {"stages": result["stages"]} if "stages" in result else result


def _walk(
    value: Any, path: tuple[str, ...] = (), held: Container[Place] = ()
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Every object below `value`, with the words that lead to it."""
    if not isinstance(value, Mapping):
        return
    yield " ".join(path), value
    for key, item in value.items():
        if key in _PASSED_OVER or key in _RESIDUALS:
            continue
        words = key.replace("_", " ")
        if not isinstance(item, list):
            yield from _walk(item, path if key in _SILENT else (*path, words), held)
        elif key != "postures" or len(item) > 1 or _words(item[0]):
            # of its only posture a joint says the same without it
            for number, one in enumerate(item, 1):
                finding = isinstance(one, Mapping) and key in _FINDINGS
                if finding and (str(one.get("cause")), one.get("joint")) in held:
                    continue
                yield from _walk(one, (*path, *(_words(one) or (words, str(number)))), held)


def _words(item: Any) -> list[str]:
    """Return what distinguishes one of a list from the others."""
    said = []
    for key in _NAMING if isinstance(item, Mapping) else ():
        value = item.get(key)
        if isinstance(value, str) and value and len(value) < 40:
            said.append(value)
        elif isinstance(value, int) and not isinstance(value, bool):
            said.append(f"{key} {value}")
    return said


def _leaves(
    value: Any, words: tuple[str, ...] = (), joint: int = 0, but: str | None = None
) -> Iterator[tuple[str, int, float]]:
    """Yield words, their joint or 0, and the number; without what is under the key `but`."""
    if _number(value):
        yield " ".join(words), joint, float(value)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            if key != but:
                yield from _leaves(item, (*words, key.replace("_", " ")), joint)
    elif isinstance(value, list):
        for index, item in enumerate(value, 1):
            yield from _leaves(item, (*words, f"joint {index}"), index)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _free(name: str, taken: Mapping[str, Any]) -> str:
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} ({number})"
    return free
