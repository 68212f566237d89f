"""What is no stage: schemas, the state of the installation."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from pipelines.errors import UsageError
from rrrid_cli.commands.application import app

__all__ = ["schema"]


@app.command()
def schema(what: Annotated[str, typer.Argument(help="model")] = "model") -> None:
    """Print the JSON schema of what rrrid writes."""
    from pipelines.log.model_file import model_schema
    from pipelines.log.results import json_text

    if what != "model":
        raise UsageError("C02", f"no schema of '{what}'", where="schema", remedy="one of: model")
    sys.stdout.write(json_text(model_schema()))
