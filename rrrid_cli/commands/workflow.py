"""The whole workflow: on one folder of logs, and on many."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from rrrid_cli.batch import BatchCommand, batch
from rrrid_cli.commands.application import app, asked, done, go
from rrrid_cli.options import (
    CauseCommand,
    Common,
    Roles,
    SomeLogs,
    StageCommand,
    with_common,
    with_common_but,
)

__all__ = ["batch", "demo", "run"]


@app.command(cls=StageCommand)
@with_common
def run(
    common: Common, roles: Roles, logs: SomeLogs = None,
    skip: Annotated[list[str] | None, typer.Option(help="Stage to leave out, such as diagnose. Repeatable.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Report what would be computed, and why; compute nothing.")] = False,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Compute everything, also what has not changed.")] = False,
) -> None:
    """Do the whole workflow on a folder of logs; one report. What has not changed is not computed again.

    Takes some 60 s for three joints and two minutes of motion, and some seconds where nothing has changed.
    """
    from pipelines.run import STAGE, plan

    given = {"skip": tuple(skip or ()) or None, "no_cache": no_cache or None}
    if not dry_run:
        go(STAGE, tuple(logs or ()), common, given, roles=roles)
    request, settings, teller = asked(STAGE, tuple(logs or ()), common, given, roles=roles)
    try:
        planned = plan(request, settings)
    finally:
        teller.done()
    if common.json:
        from pipelines.io.results import encode, headed, json_text

        sys.stdout.write(json_text(headed("run", {"stages": encode(planned)[0]})))
    elif not common.quiet:
        from rrrid_cli.console import say_table

        say_table(("stage", "would be", "because"),
                  [(one.stage, "computed" if one.computed else "cached", one.why) for one in planned])


app.command(cls=BatchCommand)(batch)


@app.command(cls=CauseCommand)
@with_common_but("robot", "assume_units", out="demo")
def demo(
    common: Common,
    fault: Annotated[list[str] | None, typer.Option(
        help="What to hide: CAUSE:JOINT:NAME=VALUE,…, or none. Repeatable. [cogging at joint 2]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of motions and noise. [1]")] = None,
) -> None:
    """A first verdict without files of one's own: simulate an arm with a fault, and run everything on its logs."""
    from pipelines import demo as recording
    from pipelines import run as workflow
    from pipelines.stage import refuse_foreign, run_stage
    from rrrid_cli.console import say_checks

    out = common.out or Path("demo")
    refuse_foreign(out / "run", common.force, workflow.STAGE.remakes)  # before the arm is simulated
    given = {"fault": tuple(fault or ()) or None, "seed": seed}
    request, settings, teller = asked(recording.STAGE, (), replace(common, out=out / "recording", no_report=True), given)
    teller("simulating the arm")
    try:
        recorded = run_stage(recording.STAGE, request, settings)
    finally:
        teller.done()
    if not common.quiet:
        print(f"Simulated {len(recorded.result.logs)} logs into {out / 'recording/logs'}; now: rrrid run {out / 'recording'}",
              file=sys.stderr)
        say_checks((check for check in recorded.checks if check.code == "RRID-C05"), stream=sys.stderr)
    hidden, stream = recording.hidden(recorded.result), sys.stderr if common.json else sys.stdout
    try:
        outcome = done(workflow.STAGE, (out / "recording",), replace(common, out=out / "run"), {})
    except BaseException:
        if not common.quiet:
            print(f"Hidden was: {hidden}.", file=sys.stderr)
        raise
    if not common.quiet:
        print(*recording.ending(recorded.result, outcome.result.diagnosis), sep="\n", file=stream)
        report = outcome.folder / "report.html"
        print(f"Report:     {report if report.exists() else 'none was asked for'}", file=stream)
        print("Next:       rrrid run FOLDER, on logs of your own; rrrid import --guess FILE drafts what makes logs of recordings",
              file=stream)
    raise typer.Exit(outcome.exit_code)
