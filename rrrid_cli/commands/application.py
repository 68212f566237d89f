"""The application, what holds for every command, and how a command runs its stage."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines import __version__
from pipelines.errors import UsageError
from rrrid_cli.console import Teller, say_outcome
from rrrid_cli.options import Common, Roles, StageGroup

if TYPE_CHECKING:
    from pipelines.stage import Outcome, Request

__all__ = ["STAGES", "app", "asked", "done", "go"]

STAGES = ("run", "inspect", "import", "convert", "fit-friction", "reconstruct", "estimate-bps", "simulate", "design-excitation",
          "validate-writing", "frf", "diagnose", "extend", "compare", "demo")

app = typer.Typer(name="rrrid", cls=StageGroup, no_args_is_help=True, add_completion=True,
                  pretty_exceptions_enable=False, rich_markup_mode=None,
                  context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
                  help="Identify robot arms from logs: what the simulation gets wrong, why, and how much better it can be.")


def _say_version(wanted: bool) -> None:
    if wanted:
        print(f"rrrid {__version__}")
        raise typer.Exit


@app.callback()
def about(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.", is_eager=True,
                                          callback=_say_version)] = False,
) -> None:
    """Options of the program itself."""


def go(stage: Any, paths: tuple[Path, ...], common: Common, given: dict[str, Any],
       fallback: dict[str, Any] | None = None, roles: Roles | None = None) -> None:
    """Run one stage as the options say, print its outcome, and end with its exit code."""
    raise typer.Exit(done(stage, paths, common, given, fallback, roles).exit_code)


def done(stage: Any, paths: tuple[Path, ...], common: Common, given: dict[str, Any],
         fallback: dict[str, Any] | None = None, roles: Roles | None = None) -> Outcome[Any]:
    """Run one stage as the options say, and print its outcome.

    Args:
        given: the command's own options; None means: not given.
        fallback: what holds where nothing else was said.
        roles: logs that are named for a role, instead of the logs' own roles.
    """
    from pipelines.stage import run_stage

    request, settings, teller = asked(stage, paths, common, given, fallback, roles)
    try:
        outcome = run_stage(stage, request, settings)
    finally:
        teller.done()
    say_outcome(outcome, as_json=common.json, quiet=common.quiet, verbose=common.verbose)
    return outcome


def asked(stage: Any, paths: tuple[Path, ...], common: Common, given: dict[str, Any],
          fallback: dict[str, Any] | None = None, roles: Roles | None = None) -> tuple[Request, Any, Teller]:
    """Return the request, the settings and the progress reporter of the options."""
    from pipelines.stage import Request
    from rrrid_cli.settings import make_settings

    if common.format not in (None, "h5", "parquet"):
        raise UsageError("C02", f"'{common.format}' is no container", where="--format", remedy="give h5 or parquet")
    settings = make_settings(stage.settings, stage.name, STAGES, common.config, common.set, given, fallback)
    teller = Teller(common.quiet or common.json, common.verbose)
    return Request(paths, common.out, common.robot, common.strict, common.check, common.force, common.no_report,
                   common.assume_units, common.format or "h5", teller, common.joints, {} if roles is None else roles.named,
                   common.session), settings, teller
