"""What is done with results: compare two, draw a report again, say what they consist of; and the state of the installation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.errors import Check, EnvironmentFault, UsageError, did_you_mean, escaped
from rrrid_cli.commands.application import STAGES, app, go
from rrrid_cli.options import Common, StageCommand, with_common_but

__all__ = ["compare", "doctor", "report", "schema"]

_SIGNS = {"ok": "·", "warn": "!", "bad": "x"}


@app.command(cls=StageCommand)
@with_common_but("robot", "assume_units", "format", "strict")
def compare(
    common: Common,
    a: Annotated[Path, typer.Argument(help="A folder that a command has left, or a stage within that of a run; its result.json, or "
                                           "a model.json.",
                                      show_default=False, readable=False, metavar="A")],
    b: Annotated[Path, typer.Argument(help="Another one of the same command.", show_default=False, readable=False, metavar="B")],
    alpha: Annotated[float | None, typer.Option(help="How often two results of one arm may be said to differ. [0.01]")] = None,
) -> None:
    """Compare two results: what differs beyond its uncertainty; with --check exit 1 where something does."""
    from pipelines.compare import STAGE

    go(STAGE, (a, b), common, {"alpha": alpha})


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that a command has left.", show_default=False,
                                           readable=False)],
    out: Annotated[Path | None, typer.Option(
        readable=False, help="Folder for the report; an earlier result of another command is kept. [DIR itself]")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what was changed as well, and keep none.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")] = False,
) -> None:
    """Draw a report again from its stored result; nothing is computed."""
    from pipelines.io.stored_result import read_result
    from pipelines.stored.redraw import redraw

    del debug  # `entry` looks for it
    checks: tuple[Check, ...] = ()
    home, target = folder.absolute(), None if out is None else out.absolute()
    if home.is_dir() and read_result(home).command == "batch":
        from pipelines.batch.redraw import redraw_batch

        drawn = redraw_batch(home, target)
    else:
        drawn, _, checks = redraw(home, target, force)
    if not quiet:
        from rrrid_cli.console import say_checks, say_verdict

        say_verdict(drawn)
        say_checks(checks)
        print(f"→ {escaped((out or folder) / 'report.html')}")


@app.command()
def doctor(
    json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Leave the self-test out.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")] = False,
) -> None:
    """Examine the installation: libraries, threads, folders, and a self-test of some seconds; exit 6 where it cannot work."""
    from pipelines.installation.examine import examine

    del debug  # `entry` looks for it
    found = []
    for one in examine(self_test=not quick):
        found.append(one)
        if not json:
            remedy = f" ({one.remedy})" if one.remedy else ""
            print(f"  {_SIGNS[one.level]} {one.name}: {one.found}{remedy}", flush=True)
    bad = [one for one in found if one.level == "bad"]
    if json:
        from pipelines.io.results import encode, headed, json_text

        sys.stdout.write(json_text(headed("doctor", {"works": not bad, "findings": encode(found)[0]})))
    else:
        print("rrrid cannot work here: see x above." if bad else "rrrid can work here.")
    raise typer.Exit(EnvironmentFault.exit_code if bad else 0)


@app.command()
def schema(
    what: Annotated[str, typer.Argument(help="A command, for its result.json; model; log.")] = "model",
) -> None:
    """Print the JSON schema of what rrrid writes: of a command's result.json, of model.json, or of a log."""
    from pipelines.io.results import json_text

    sys.stdout.write(json_text(_schema(what)))


def _schema(what: str) -> dict[str, Any]:
    from pipelines.io.log_schema import log_schema
    from pipelines.io.model_file import model_schema
    from pipelines.io.result_schema import result_schema
    from pipelines.stage import result_type
    from rrrid_cli.settings import stage_of

    if what in ("model", "log"):
        return model_schema() if what == "model" else log_schema()
    if what == "batch":
        from pipelines.batch.result import Result

        return result_schema(Result, what)
    if what not in STAGES:
        known = ("model", "log", "batch", *STAGES)
        raise UsageError("C02", f"no schema of '{what}'{did_you_mean(what, known)}", where="schema",
                         remedy=f"one of: {', '.join(known)}")
    return result_schema(result_type(stage_of(what)), what)
