"""What two results that are compared are called, where their comparison goes, and what to name instead of two that cannot be."""

from __future__ import annotations

from itertools import takewhile

from pipelines.errors import UsageError
from pipelines.io.places import written_by
from pipelines.io.stored_result import StoredResult

__all__ = ["called", "label_of", "of_other_commands"]

_RESULT, _MODEL = "result.json", "model.json"


def called(a: StoredResult, b: StoredResult) -> tuple[str, str]:
    """What the two are called: as much of their paths, from the end, as tells them apart; nothing of where they lie."""
    parts = [_path(one) for one in (a, b)]
    for depth in range(1, 5):
        names = ["/".join(part[-depth:]) for part in parts]
        if names[0] != names[1]:
            return names[0], names[1]
    return f"{parts[0][-1]} (A)", f"{parts[1][-1]} (B)"


def _path(one: StoredResult) -> tuple[str, ...]:
    return one.folder.parts if one.path.name == _RESULT else one.path.parts


def label_of(a: StoredResult, b: StoredResult) -> str:
    """What the default --out calls the two, so that no comparison takes the place of another: "monday-and-friday-estimate-bps"."""
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
    """The logs it is of, the command, the stage of a run, and the file, as far as its place says so.

    In runs/ROBOT/LABEL/COMMAND it is of the logs LABEL; beside that lies what `extend` has moved aside, COMMAND-CAUSE.
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
    """C02, with what can be compared of the two instead: a stage within a run, or the models that both have left."""
    return UsageError(
        "C02",
        f"results of different commands: {a.command} and {b.command}",
        where="compare",
        remedy=_instead(a, b) or _instead(b, a) or _models(a, b),
    )


def _instead(run: StoredResult, other: StoredResult) -> str:
    """The stage of a run that the other is a result of."""
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
