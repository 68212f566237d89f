"""Plan an experiment before it is made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rrrid_cli.commands.application import app, go
from rrrid_cli.options import CauseCommand, Common, numbers, whole_numbers, with_common

__all__ = ["design_excitation"]


@app.command("design-excitation", cls=CauseCommand)
@with_common
def design_excitation(
    common: Common,
    name: Annotated[str | None, typer.Argument(metavar="ROBOT", show_default=False,
                                               help="Description, URDF, log or shipped name. [robot.toml here, else rrr]")] = None,
    experiment: Annotated[str | None, typer.Option(help="excitation, friction, frf or hold. [excitation]")] = None,
    criterion: Annotated[str | None, typer.Option(help="default (A with condition 3), condition, frobenius, E, D or A.")] = None,
    cond_max: Annotated[float | None, typer.Option(help="Ceiling on the condition number. [default: 3]")] = None,
    harmonics: Annotated[list[str] | None, typer.Option(help="Harmonics: one number, or one a joint.")] = None,
    frequency: Annotated[list[str] | None, typer.Option(help="Fundamental [Hz]: one, or one a joint. [0.1]")] = None,
    stop_band: Annotated[list[str] | None, typer.Option(help="Bands without harmonics [Hz]: 4,6 or 4,6,11,13.")] = None,
    time_limit: Annotated[float | None, typer.Option(help="Time to search, in seconds of computing. [30]")] = None,
    evaluations: Annotated[int | None, typer.Option(help="Search so many evaluations instead: repeatable exactly.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the search. [1]")] = None,
    symmetric: Annotated[bool | None, typer.Option("--symmetric", help="Mirror-symmetric links: p4 = p15 = 0.")] = None,
    model: Annotated[str | None, typer.Option(help="Model that predicts torque. [the described links]")] = None,
    bounds: Annotated[str | None, typer.Option(help="Bounds on the parameters (TOML), where no model is known.")] = None,
    prior_logs: Annotated[list[Path] | None, typer.Option(readable=False,
                                                          help="Earlier logs, or a result of frf. Repeatable.")] = None,
    home: Annotated[list[str] | None, typer.Option(help="Posture to start from [rad], one a joint: 0,-1.57,0.")] = None,
    no_rest: Annotated[bool, typer.Option("--no-rest", help="In motion at both ends, with run-in and run-out.")] = False,
    periods: Annotated[int | None, typer.Option(help="How often the period is repeated. [1]")] = None,
    friction: Annotated[bool | None, typer.Option("--friction/--no-friction", help="Count columns of friction as well.")] = None,
    random: Annotated[bool | None, typer.Option("--random", help="frf: random noise in the place of odd multisines.")] = None,
    tip_speed: Annotated[float | None, typer.Option(help="Limit on the speed of the tip [m/s].")] = None,
    tip_box: Annotated[list[str] | None, typer.Option(help="Box for the tip [m]: x from,to, y from,to, z from,to.")] = None,
    recipe: Annotated[str | None, typer.Option(help="Recipe of import: controller.csv in its order, units and rate.")] = None,
    discriminate: Annotated[tuple[str, str] | None, typer.Option(
        metavar="CAUSE CAUSE", help="Two causes that the motion shall separate: spring:2 cogging:2:order=1.")] = None,
) -> None:
    """Design the excitation, or another experiment, that tells most within the robot's limits."""
    from pipelines.design_excitation import STAGE

    go(STAGE, tuple(prior_logs or ()), common, {
        "robot": name, "experiment": experiment, "criterion": criterion, "cond_max": cond_max,
        "harmonics": whole_numbers(harmonics, "--harmonics"), "frequency": numbers(frequency, "--frequency"),
        "stop_band": numbers(stop_band, "--stop-band"), "time_limit": time_limit, "evaluations": evaluations, "seed": seed,
        "symmetric": symmetric, "model": model, "bounds": bounds, "home": numbers(home, "--home"),
        "rest": False if no_rest else None, "periods": periods, "friction": friction, "random": random, "tip_speed": tip_speed,
        "tip_box": numbers(tip_box, "--tip-box"), "recipe": recipe, "discriminate": discriminate})
