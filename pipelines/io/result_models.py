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
    """`result` without the findings, and baseline effects, that are `held`."""
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
