"""What is no stage: schemas, the state of the installation."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer

from pipelines.errors import UsageError, did_you_mean
from rrrid_cli.commands.application import STAGES, app

__all__ = ["schema"]


@app.command()
def schema(
    what: Annotated[str, typer.Argument(help="A command, for its result.json; model, for model.json; log.")] = "model",
) -> None:
    """Print the JSON schema of what rrrid writes: of a command's result.json, of model.json, or of a log's description."""
    from pipelines.log.results import json_text

    sys.stdout.write(json_text(_schema(what)))


def _schema(what: str) -> dict[str, Any]:
    from pipelines.log.log_schema import log_schema
    from pipelines.log.model_file import model_schema
    from pipelines.log.result_schema import result_schema
    from pipelines.stage import result_type
    from rrrid_cli.settings import stage_of

    if what in ("model", "log"):
        return model_schema() if what == "model" else log_schema()
    if what not in STAGES:
        known = ("model", "log", *STAGES)
        raise UsageError("C02", f"no schema of '{what}'{did_you_mean(what, known)}", where="schema",
                         remedy=f"one of: {', '.join(known)}")
    return result_schema(result_type(stage_of(what)), what)
