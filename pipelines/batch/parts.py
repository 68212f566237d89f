"""What is known of one robot's logs of one day: followed from item to item, and held against a baseline.

    part = part_of(result, robot, recorded)       of an item's result.json
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipelines.report.result_figures import fitted, residuals

__all__ = ["Part", "part_of", "place_of", "read_part"]


@dataclass(frozen=True)
class Part:
    """One robot's logs of one day."""

    robot: str = ""
    recorded: str = ""  # the earliest of its logs
    figures: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)  # name -> value, std, unit
    residuals: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    findings: tuple[Mapping[str, Any], ...] = ()  # of a diagnosis: cause, joint, parameters
    diagnosed: bool = False  # its result names causes, be it none
    verdict: str = ""  # of a diagnosis: "cause", "no-fault-found", "unknown", "cannot-judge"
    baseline_effects: tuple[str, ...] = ()  # what the reference logs show as well: "stribeck:2"
    detection_limits: Mapping[str, tuple[str, float]] = field(default_factory=dict)  # "cogging:2" -> parameter, limit


def part_of(result: Mapping[str, Any], robot: str, recorded: str, turning: Sequence[bool] = ()) -> Part:
    """Return what an item's result.json says; `turning`: which of the robot's joints are revolute."""
    findings = tuple({key: one.get(key) for key in ("cause", "joint", "parameters")} for one in result.get("findings") or ())
    least = {place_of(one): (str(one["parameter"]), float(one["minimum"]["value"])) for one in result.get("detection_limits") or ()
             if (one.get("minimum") or {}).get("value") is not None and not one.get("or_less")}
    return Part(robot, recorded, fitted(result), residuals(result, turning), findings, result.get("findings") is not None,
                str(result.get("verdict") or ""), tuple(map(place_of, result.get("baseline_effects") or ())), least)


def place_of(one: Mapping[str, Any]) -> str:
    """A cause where it is, as commands take it: "cogging:2"."""
    return str(one["cause"]) if one["joint"] is None else f"{one['cause']}:{one['joint']}"


def read_part(about: Mapping[str, Any]) -> Part:
    """The part that was written as JSON."""
    told: dict[str, Any] = {
        "figures": {name: (float(v), float(s), str(u)) for name, (v, s, u) in about["figures"].items()},
        "residuals": {name: (float(v), str(u)) for name, (v, u) in about["residuals"].items()},
        "detection_limits": {name: (str(parameter), float(least))
                             for name, (parameter, least) in about["detection_limits"].items()},
        "findings": tuple(about["findings"]), "baseline_effects": tuple(about["baseline_effects"])}
    return Part(**{**about, **told})
