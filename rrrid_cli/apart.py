"""Do one command on each robot and day of a folder that holds several, one after the other, as `rrrid run` does.

Each leaves an output of its own, the very one that the command leaves with --session; nothing of one goes into another.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.errors import RrridError, UsageError, clean
from rrrid_cli.console import Teller, say_error, say_outcome

if TYPE_CHECKING:
    from pipelines.log.mixed import SeveralSessions
    from pipelines.stage import Request
    from rrrid_cli.options import Common

__all__ = ["each_by_itself"]

_OF_ITS_OWN = (2, 3, 5)  # exit codes of what is wrong with the logs or the options of one; anything else ends the command


def each_by_itself(stage: Any, request: Request, settings: Any, several: SeveralSessions, common: Common, teller: Teller) -> int:
    """The stage on every session that `several` names, printed one after the other; the exit code of all.

    Raises:
        UsageError: C05, `request.out` holds anything else than such outputs.
        EnvironmentFault: disk full, no permission; what was done before stays.
    """
    from pipelines.stage import slug

    if request.out is not None:
        _refuse_taken(request.out, stage.name)
    stream = sys.stderr if common.json else sys.stdout
    if not common.quiet:
        print(f"{clean(several.message[:1].upper() + several.message[1:])}. Each by itself:", file=stream)
    codes, objects = [], []
    for name in several.names:
        out = None if request.out is None else request.out / slug(name.replace(" ", "-"))
        if not common.quiet:
            print(f"\n{clean(name, 80)}", file=stream, flush=True)
        code, told = _one(stage, replace(request, session=name, out=out), settings, common, teller)
        codes.append(code)
        objects.append({"name": clean(name), **told})
    if common.json:
        from pipelines.log.results import headed, json_text

        sys.stdout.write(json_text(headed(stage.name, {"runs": objects})))
    return _exit_code(codes)


def _one(stage: Any, request: Request, settings: Any, common: Common, teller: Teller) -> tuple[int, dict[str, Any]]:
    """One session: its exit code and its object. What is wrong with it is said, and costs the others nothing."""
    from pipelines.stage import run_stage
    from rrrid_cli.usage import as_given

    try:
        outcome = run_stage(stage, request, settings)
    except RrridError as problem:
        if problem.exit_code not in _OF_ITS_OWN:
            raise
        teller.done()
        told = as_given(problem, sys.argv[1:])
        say_error(told, as_json=False)
        return told.exit_code, {"error": told.as_dict(), "exit": told.exit_code}
    teller.done()
    say_outcome(replace(outcome, json={}), as_json=False, quiet=common.quiet, verbose=common.verbose,
                stream=sys.stderr if common.json else None)
    return outcome.exit_code, outcome.json


def _refuse_taken(out: Path, command: str) -> None:
    """C05: outputs of several sessions lie beside each other in `out`, and nothing else does."""
    from pipelines.log.places import holds_apart

    if out.exists() and not holds_apart(out, command) and any(out.iterdir()):
        raise UsageError("C05", "holds an output of one robot and day, and these are several", where=out,
                         remedy="choose another folder with --out")


def _exit_code(codes: Sequence[int]) -> int:
    """As `run`: what has no log for the command is passed over, unless none has; what could not be used comes first."""
    done = [code for code in codes if code != 5]
    return next((code for code in (3, 2) if code in done), max(done)) if done else 5
