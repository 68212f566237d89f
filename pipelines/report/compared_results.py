"""Say what two compared results are called, where their comparison goes, and what both have.

A model that was fitted says the numbers of a cause again that a finding has said: a figure that
both `extend` and its model have counts once.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from itertools import takewhile
from typing import Any, Final

from pipelines.errors import UsageError
from pipelines.io.output import written_by
from pipelines.io.results import StoredResult

__all__ = ["called", "label_of", "less_findings", "modelled", "of_other_commands"]

_RESULT, _MODEL = "result.json", "model.json"


def called(a: StoredResult, b: StoredResult) -> tuple[str, str]:
    """Return the names of the two: as much of their paths, from the end, as differs."""
    parts = [_path(one) for one in (a, b)]
    for depth in range(1, 5):
        names = ["/".join(part[-depth:]) for part in parts]
        if names[0] != names[1]:
            return names[0], names[1]
    return f"{parts[0][-1]} (A)", f"{parts[1][-1]} (B)"


def _path(one: StoredResult) -> tuple[str, ...]:
    return one.folder.parts if one.path.name == _RESULT else one.path.parts


def label_of(a: StoredResult, b: StoredResult) -> str:
    """Return the default --out of the two: "monday-and-friday-estimate-bps"."""
    first, second = _belonging(a), _belonging(b)
    if a.path == b.path and a.folder == b.folder:
        return "-".join(first)
    head = len(tuple(takewhile(_alike, zip(first, second, strict=False))))
    own, other = first[head:], second[head:]
    tail = len(tuple(takewhile(_alike, zip(own[:0:-1], other[:0:-1], strict=False))))
    if not own or not other:
        return f"{'-'.join(first)}-and-{'-'.join(second)}"
    apart = "-and-".join("-".join(part[: len(part) - tail]) for part in (own, other))
    return "-".join((*first[:head], apart, *own[len(own) - tail :]))


def _alike(pair: tuple[str, str]) -> bool:
    return pair[0] == pair[1]


def _belonging(one: StoredResult) -> tuple[str, ...]:
    """Return the logs it is of, the command, the stage of a run, and the file.

    In runs/ROBOT/LABEL/COMMAND it is of the logs LABEL.
    """
    owner = next(
        (folder for folder in (one.folder, *one.folder.parents[:2]) if written_by(folder)),
        one.folder,
    )
    command = written_by(owner)
    usual = bool(command) and (owner.name == command or owner.name.startswith(f"{command}-"))
    parts = ((owner.parent.name,) if usual else ()) + (
        owner.name,
        *one.folder.relative_to(owner).parts,
    )
    return parts if one.path.name == _RESULT else (*parts, one.path.stem)


def of_other_commands(a: StoredResult, b: StoredResult) -> UsageError:
    """Return C02, with what can be compared instead: a stage within a run, or two models."""
    return UsageError(
        "C02",
        f"results of different commands: {a.command} and {b.command}",
        where="compare",
        remedy=_instead(a, b) or _instead(b, a) or _models(a, b),
    )


def _instead(run: StoredResult, other: StoredResult) -> str:
    """Return the stage of a run that the other is a result of."""
    names = (
        [one.get("name") for one in run.object.get("stages") or ()] if run.command == "run" else []
    )
    return (
        f"name that stage of the run: {run.folder / other.command}"
        if other.command in names
        else ""
    )


def _models(a: StoredResult, b: StoredResult) -> str:
    files = [one.path if one.command == "model" else one.folder / _MODEL for one in (a, b)]
    without = sorted(
        {one.command for one, file in zip((a, b), files, strict=True) if not file.is_file()}
    )
    if not without and files[0] == files[1]:
        return "compare two of one command, or this model.json with that of another result"
    if not without:
        return f"compare two of one command, or their models: rrrid compare {files[0]} {files[1]}"
    return f"compare two of one command, or two model.json; {' and '.join(without)} left none there"


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
