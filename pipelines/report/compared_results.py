"""Say what two compared results are called, and what both have.

A model that was fitted says the numbers of a cause again that a finding has said: a figure that
both `extend` and its model have counts once.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import Any, Final

from pipelines.io.results import StoredResult

__all__ = ["called", "less_findings", "modelled"]


def called(a: StoredResult, b: StoredResult) -> tuple[str, str]:
    """Return the names of the two: as much of their paths, from the end, as differs."""
    files = [one.path.parent if one.path.name == "result.json" else one.path for one in (a, b)]
    for depth in range(1, 5):
        names = ["/".join(file.parts[-depth:]) for file in files]
        if names[0] != names[1]:
            return names[0], names[1]
    return f"{files[0].name} (A)", f"{files[1].name} (B)"


Place = tuple[str, int | None]  # cause; joint, from 1
_FINDINGS: Final = ("findings", "baseline_effects")


def modelled(result: Mapping[str, Any]) -> frozenset[Place]:
    """Every law and effect of every model in `result`: a stage's, a run's, or a model file's.

    Raises:
        KeyError, TypeError, AttributeError: it is no result.
    """
    return frozenset(_held(result))


def _held(result: Mapping[str, Any]) -> Iterator[Place]:
    for kind in ("friction", "effects") if "base_parameters" in result else ():
        yield from ((str(one["effect"]), one["joint"]) for one in result[kind])
    if isinstance(result.get("model"), Mapping):
        yield from _held(result["model"])
    for step in result.get("stages") or ():
        yield from _held(step.get("result") or {})


def less_findings(result: Mapping[str, Any], held: Container[Place]) -> dict[str, Any]:
    """Return `result` without the findings, and baseline effects, that are `held`."""
    less = dict(result)
    for kind in _FINDINGS:
        if isinstance(less.get(kind), list):
            less[kind] = [one for one in less[kind] if not _is_held(one, held)]
    if less.get("stages"):
        less["stages"] = [
            {**step, "result": less_findings(step["result"], held)} if step.get("result") else step
            for step in less["stages"]
        ]
    return less


def _is_held(finding: Any, held: Container[Place]) -> bool:
    return (
        isinstance(finding, Mapping) and (str(finding.get("cause")), finding.get("joint")) in held
    )
