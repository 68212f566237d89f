"""Diagnose what the simulation gets wrong, and extend the model."""

from __future__ import annotations

from typing import Annotated

import typer

from rrrid_cli.commands.application import app, go
from rrrid_cli.options import (
    CauseCommand,
    Common,
    Roles,
    SomeLogs,
    numbers,
    with_common,
    with_common_but,
)

__all__ = ["diagnose", "extend"]


@app.command(cls=CauseCommand)
@with_common_but("format")
def diagnose(
    common: Common, roles: Roles,
    logs: SomeLogs = None,
    exclude: Annotated[list[str] | None, typer.Option(help="Exclude this cause: cogging; all causes are listed below. "
                                                      "Repeatable.")] = None,
    model: Annotated[str | None, typer.Option(help="model.json whose friction laws are taken. [Coulomb and viscous]")] = None,
    max_causes: Annotated[int | None, typer.Option(help="Largest number of causes to look for. [4]")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    cutoff_hz: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [of the motion, 10..25]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [2.6 a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    skip_sanity_checks: Annotated[bool | None, typer.Option("--skip-sanity-checks",
                                                            help="Diagnose torque that fails its checks.")] = None,
) -> None:
    """Find what the simulation gets wrong, why, what to check, and how much better the model becomes.

    Takes some 30 s for three joints and two minutes of motion. Logs of role reference, recorded while the arm was
    healthy, turn the question into what has changed since.
    """
    from pipelines.diagnose import STAGE

    go(STAGE, tuple(logs or ()), common, {
        **roles.named, "exclude": tuple(exclude or ()) or None, "model": model,
        "max_causes": max_causes, "blocks": blocks, "cutoff_hz": cutoff_hz, "decimate": decimate,
        "min_speed": numbers(min_speed, "--min-speed"), "skip_sanity_checks": skip_sanity_checks})


@app.command(cls=CauseCommand)
@with_common
def extend(
    common: Common, roles: Roles,
    logs: SomeLogs = None,
    with_: Annotated[list[str] | None, typer.Option("--with", help="CAUSE:JOINT, or CAUSE:JOINT:NAME=VALUE with a start for a "
                                                    "non-linear number: cogging:2:order=18; all causes are listed below. "
                                                    "What may act more than once at a joint, waves of several orders say, "
                                                    "does so as held-out logs confirm. Repeatable.")] = None,
    model: Annotated[str | None, typer.Option(help="model.json to extend: its effects are kept, and fitted anew.")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    cutoff_hz: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [of the motion, 10..25]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [2.6 a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    skip_sanity_checks: Annotated[bool | None, typer.Option("--skip-sanity-checks",
                                                            help="Fit torque that fails its checks.")] = None,
) -> None:
    """Extend the model by named causes, refit everything, and judge it on held-out logs.

    Takes some 10 s for three joints and two minutes of motion. Without --out an earlier model that this one
    does not make anew, refused or with another cause, is kept beside the output folder, and that is said; an earlier
    extension in --out DIR is replaced.
    """
    from pipelines.extend import STAGE

    go(STAGE, tuple(logs or ()), common, {
        "causes": tuple(with_ or ()) or None, **roles.named, "model": model, "blocks": blocks,
        "cutoff_hz": cutoff_hz, "decimate": decimate, "min_speed": numbers(min_speed, "--min-speed"),
        "skip_sanity_checks": skip_sanity_checks})
