"""What the models of a result hold, and the result without what its findings say of it a second time.

`extend` says the numbers of a cause as a finding, and again in the model that it has fitted; in a run `diagnose` has said them
before. Whoever counts figures counts each once.

    held = modelled(result)                  the laws and effects of its models
    less_findings(result, held)              the result without the findings that are among them
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import Any, Final

__all__ = ["Place", "less_findings", "modelled"]

Place = tuple[str, str, int | None]  # the part of a run with several robots or days, else ""; cause; joint, from 1
_FINDINGS: Final = ("findings", "baseline_effects")


def modelled(result: Mapping[str, Any], part: str = "") -> frozenset[Place]:
    """Every law and effect of every model in `result`: a stage's, a run's, or a model file's.

    Raises:
        KeyError, TypeError, AttributeError: it is no result.
    """
    return frozenset(_held(result, part))


def _held(result: Mapping[str, Any], part: str) -> Iterator[Place]:
    for kind in ("friction", "effects") if "base_parameters" in result else ():
        yield from ((part, str(one["effect"]), one["joint"]) for one in result[kind])
    if isinstance(result.get("model"), Mapping):
        yield from _held(result["model"], part)
    for step in result.get("stages") or ():
        yield from _held(step.get("result") or {}, part)
    for run in result.get("runs") or ():
        yield from _held(run, run["name"])


def less_findings(result: Mapping[str, Any], held: Container[Place], part: str = "") -> dict[str, Any]:
    """`result` without the findings, and baseline effects, that are `held`."""
    less = dict(result)
    for kind in _FINDINGS:
        if isinstance(less.get(kind), list):
            less[kind] = [one for one in less[kind] if not _is_held(one, held, part)]
    if less.get("stages"):
        less["stages"] = [{**step, "result": less_findings(step["result"], held, part)} if step.get("result") else step
                          for step in less["stages"]]
    if less.get("runs"):
        less["runs"] = [less_findings(run, held, run["name"]) for run in less["runs"]]
    return less


def _is_held(finding: Any, held: Container[Place], part: str) -> bool:
    return isinstance(finding, Mapping) and (part, str(finding.get("cause")), finding.get("joint")) in held
