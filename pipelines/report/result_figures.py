"""Take out of a stage's result the fitted figures with their std, and the residuals.

A figure is what has `value`, `std` and `unit`; a residual is what bears one of a few names. Each
gets a name in words from where it is: "p1", "joint 2 viscous", "cogging joint 2 amplitude",
"nominal model residual rms", "extended model residual rms".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from pipelines.io.sandbox import TomlError, parse_toml

__all__ = ["fitted", "name_in", "numbers_of", "residuals", "robot_of"]

# What a result calls the error that is left, its words, and its unit; arrays are per joint.
_RESIDUALS: Final = {
    "torque_rms": ("torque rms", "N m"),
    "residual_rms": ("nominal model residual rms", "N m"),
    "after_rms": ("extended model residual rms", "N m"),
    "relative_error": ("relative error", "1"),
    "reconstruction_error_max": ("reconstruction error max", "rad"),
}
_SAID_BEFORE: Final = {
    "after_rms": "noise_floor"
}  # it is no model's, and stands with the nominal one already
_SLIDING: Final = {"N m": "N", "rad": "m"}  # of a joint that slides
# Fields that name one of a list; containers without a name; what the stage itself judges.
_NAMING: Final = ("name", "label", "effect", "cause", "kind", "law", "joint", "posture", "method")
_SILENT: Final = ("parameters", "result", "torque")
_PASSED_OVER: Final = (
    "balance",
    "comparison",
    "candidate_laws",
    "rejected",
    "detection_limits",
    "courses",
)
_PICTURES: Final = "previews"  # whose units are of position and torque, not of joints
_A_MODEL: Final = "model"  # whose "robot" is a whole description


def fitted(result: Mapping[str, Any], most: int = 400) -> dict[str, tuple[float, float, str]]:
    """Name -> (value, std, unit) of every figure of `result` whose std is known."""
    found: dict[str, tuple[float, float, str]] = {}
    for name, holder in _figures(result):
        value, std = holder["value"], holder["std"]
        if _number(value) and _number(std) and std > 0.0 and len(found) < most:
            found[_free(name, found)] = (float(value), float(std), str(holder["unit"]))
    return found


def numbers_of(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the name of every figure of `result`, with a std or without."""
    return tuple(dict.fromkeys(name for name, _ in _figures(result)))


def _figures(result: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, holder in _walk(_single(result), ()):
        if isinstance(holder, Mapping) and {"value", "std", "unit"} <= set(holder):
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
    for name, holder in _walk(_single(result), ()):
        for key, (called, unit) in _RESIDUALS.items():
            if isinstance(holder, Mapping) and key in holder:
                for words, joint, value in _leaves(holder[key], but=_SAID_BEFORE.get(key)):
                    if len(found) < most:
                        full = " ".join(filter(None, (name, called, words)))
                        found[_free(full, found)] = (
                            value,
                            _SLIDING.get(unit, unit) if joint in slides else unit,
                        )
    return found


def _sliding(value: Any) -> set[int]:
    """Return the joints, from 1, that slide by the units of a result."""
    if isinstance(value, Mapping):
        told = [
            unit
            for key in ("units", "torque_units")
            if isinstance(value.get(key), list)
            for unit in enumerate(value[key], 1)
        ]
        return {j for j, unit in told if unit in _SLIDING.values()}.union(
            *(_sliding(item) for key, item in value.items() if key != _PICTURES)
        )
    return set[int]().union(*map(_sliding, value)) if isinstance(value, list) else set()


def robot_of(result: Any) -> str:
    """Return the name of the first robot that a result is of; "" where it says none."""
    if isinstance(result, Mapping):
        if "base_parameters" in result and isinstance(
            result.get("robot"), str
        ):  # a model file, with a whole description
            return name_in(result["robot"])
        if isinstance(result.get("robot"), str):
            return str(result["robot"])
        return next(
            filter(None, (robot_of(item) for key, item in result.items() if key != _A_MODEL)), ""
        )
    return next(filter(None, map(robot_of, result)), "") if isinstance(result, list) else ""


def name_in(robot: str) -> str:
    """Return the name in a robot description, "" without one."""
    try:
        return str(parse_toml(robot).get("name", ""))
    except TomlError:
        return ""


def _single(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the stages of a run alone: all else in its result repeats them."""
    return {"stages": result["stages"]} if "stages" in result else result


def _walk(value: Any, path: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """Every object below `value`, with the words that lead to it."""
    if isinstance(value, Mapping):
        yield " ".join(path), value
        for key, item in value.items():
            if key in _PASSED_OVER or key in _RESIDUALS:
                continue
            words = key.replace("_", " ")
            if isinstance(item, list):
                if key == "postures" and len(item) == 1 and not _words(item[0]):
                    continue  # of its only posture a joint says the same without it
                for number, one in enumerate(item, 1):
                    yield from _walk(one, (*path, *(_words(one) or (words, str(number)))))
            else:
                yield from _walk(item, path if key in _SILENT else (*path, words))


def _words(item: Any) -> list[str]:
    """Return what distinguishes one of a list from the others."""
    if not isinstance(item, Mapping):
        return []
    said = []
    for key in _NAMING:
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
