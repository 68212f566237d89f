"""Look at logs, make them, and bring them into another container."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from pipelines.errors import UsageError
from rrrid_cli.commands.application import app, go
from rrrid_cli.options import Common, LogPaths, StageCommand, with_common_but

__all__ = ["convert", "import_", "inspect"]


TrustUnits = Annotated[bool | None, typer.Option("--trust-units", help="Units are as declared, however large the numbers.")]
AllowOverlap = Annotated[bool | None, typer.Option("--allow-overlap", help="One recording may be fitted and judged by.")]


@app.command(cls=StageCommand)
@with_common_but("format")
def inspect(
    logs: LogPaths, common: Common, trust_units: TrustUnits = None,
    allow_overlap: AllowOverlap = None,
) -> None:
    """The log doctor: check container, units, time and signals; nothing is changed."""
    from pipelines.inspect import STAGE

    go(STAGE, tuple(logs), common, {"trust_units": trust_units, "allow_overlap": allow_overlap})


@app.command("import", cls=StageCommand)
@with_common_but("check")
def import_(
    common: Common,
    recipe: Annotated[str | None,
                      typer.Argument(help="Recipe: a TOML file, or the name of a shipped one.", show_default=False)] = None,
    source: Annotated[Path | None, typer.Option(readable=False, help="Folder the recordings are in. [the recipe's]")] = None,
    map: Annotated[list[str] | None, typer.Option(help="Column to take for a signal: q_1=Joint_1. Repeatable.")] = None,
    trust_units: TrustUnits = None,
    guess: Annotated[Path | None, typer.Option(
        readable=False, help="Draft a recipe for this recording, with the evidence; print it.")] = None,
) -> None:
    """Make logs of recordings (CSV, JSON, MAT, NPY) by a recipe."""
    if guess is not None:
        _guess(guess, common)
        return
    if recipe is None:
        raise UsageError("C02", "no recipe", where="import", remedy="name a recipe, or draft one with --guess FILE")
    from pipelines.import_log import STAGE

    go(STAGE, (), common, {"recipe": recipe, "source": source, "map": tuple(map or ()) or None, "trust_units": trust_units})


@app.command(cls=StageCommand)
@with_common_but("check")
def convert(
    logs: LogPaths, common: Common,
    to: Annotated[str | None, typer.Option(help="h5, parquet or csv; goes before --format. [what the log is not in]")] = None,
) -> None:
    """Convert logs from HDF5 to Parquet and back, or to flat CSV."""
    from pipelines.convert import STAGE

    go(STAGE, tuple(logs), common, {"to": to}, {"to": common.format})


def _guess(path: Path, common: Common) -> None:
    from pipelines.import_log import draft_recipe

    drafted = draft_recipe(path, common.robot)
    if common.out is not None:
        raise UsageError("C02", "--guess prints its draft", where="--out",
                         remedy="redirect it: rrrid import --guess FILE > recipe.toml")
    if common.json:
        from pipelines.io.results import encode, json_text

        sys.stdout.write(json_text(encode(drafted)[0]))
    else:
        sys.stdout.write(drafted.text)
