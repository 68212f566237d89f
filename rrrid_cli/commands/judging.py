"""Compare a model with logs: simulate, validate, measure compliance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rrrid_cli.commands.application import app, go
from rrrid_cli.options import (
    CauseCommand,
    Common,
    Roles,
    SomeLogs,
    StageCommand,
    numbers,
    whole_numbers,
    with_common,
    with_common_but,
)

__all__ = ["frf", "simulate", "validate_writing"]


@app.command(cls=CauseCommand)
@with_common_but("check")
def simulate(
    common: Common,
    model: Annotated[str, typer.Argument(help="The model.json of estimate-bps, or the shipped 'rrr'.", show_default=False)],
    replay: Annotated[list[Path] | None, typer.Option(readable=False, help="Log to replay, or a folder. Repeatable.")] = None,
    fault: Annotated[list[str] | None, typer.Option(
        help="CAUSE:JOINT:NAME=VALUE,…: quadratic_drag:2:coefficient=0.1. Repeatable. All causes are listed below; a "
             "wrong NAME is refused with a list of the right ones.")] = None,
    replicas: Annotated[int | None, typer.Option(help="Simulations that differ in their noise; windows have one. [1]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first one's noise. [1]")] = None,
    noise: Annotated[list[str] | None, typer.Option(
        help="Torque noise of the drives, std [N m], one or one a joint: 0.02,0.01,0.005. Windows have none. [0]")] = None,
    windowed: Annotated[bool | None, typer.Option("--windowed", help="In short windows, though the controller is known.")] = None,
    window: Annotated[float | None, typer.Option(help="Length of such a window [s]. [0.1]")] = None,
    steps: Annotated[int | None, typer.Option(help="Runge-Kutta steps a sample; 1 to 1000. [as few as the error allows]")] = None,
) -> None:
    """Simulate a model as a log's experiment would have it, optionally with a fault."""
    from pipelines.simulate import STAGE

    go(STAGE, tuple(replay or ()), common, {
        "model": model, "fault": tuple(fault or ()) or None, "replicas": replicas, "seed": seed,
        "noise": numbers(noise, "--noise"), "windowed": windowed, "window": window, "steps": steps})


@app.command("validate-writing", cls=StageCommand)
@with_common
def validate_writing(
    common: Common, roles: Roles,
    logs: Annotated[list[Path] | None, typer.Argument(help="Logs, or folders of logs; none to design the task alone.",
                                                      show_default=False, metavar="LOGS", readable=False)] = None,
    model: Annotated[str | None, typer.Option(help="model.json to judge. [the folder's, else fitted to its logs]")] = None,
    torque_gate: Annotated[float | None, typer.Option(help="Largest relative torque error of a joint. [0.1]")] = None,
    draws: Annotated[int | None, typer.Option(help="Models that simulated control cases run on in turn. [5]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of those, and of via points. [1]")] = None,
    no_simulation: Annotated[bool, typer.Option("--no-simulation", help="Judge by what was recorded alone.")] = False,
    text: Annotated[str | None, typer.Option(help="Design this writing task instead: trajectory.h5 for the robot.")] = None,
    plane_y: Annotated[float | None, typer.Option(help="Plane of the letters, y [m]. [-0.4]")] = None,
    x: Annotated[float | None, typer.Option(help="Middle of the text, x [m]. [0]")] = None,
    z: Annotated[float | None, typer.Option(help="Middle of the text, z [m]. [0.56]")] = None,
    size: Annotated[float | None, typer.Option(help="Height of a letter [m]. [0.12]")] = None,
    speed: Annotated[float | None, typer.Option(help="Speed of the tip in fast phases [m/s]. [0.6]")] = None,
    slow: Annotated[float | None, typer.Option(help="In slow phases, from a line into an arc [m/s]. [0.05]")] = None,
    acceleration: Annotated[float | None, typer.Option(help="Largest acceleration of the tip [m/s^2]. [6]")] = None,
    elbow: Annotated[str | None, typer.Option(help="up or down, of the RRR arm. [up]")] = None,
    posture: Annotated[list[str] | None, typer.Option(help="Posture near the task [rad], of any other arm.")] = None,
    via_points: Annotated[int | None, typer.Option(help="Design so many moves between random postures instead.")] = None,
    recipe: Annotated[str | None, typer.Option(help="Recipe of import: controller.csv in its order, units and rate.")] = None,
) -> None:
    """Validate the model on the writing task: torque, six control cases, simulation; or design the task."""
    from pipelines.validate_writing import STAGE

    go(STAGE, tuple(logs or ()), common, {
        "model": model, "torque_gate": torque_gate, "draws": draws, "seed": seed, "simulate": False if no_simulation else None,
        "text": text, "plane_y": plane_y, "x": x, "z": z, "size": size, "speed": speed, "slow": slow,
        "acceleration": acceleration, "elbow": elbow,
        "posture": numbers(posture, "--posture"), "via_points": via_points, "recipe": recipe}, roles=roles)


@app.command(cls=StageCommand)
@with_common_but("format")
def frf(
    common: Common, roles: Roles, logs: SomeLogs = None,
    estimator: Annotated[str | None, typer.Option(help="auto, multisine, local-polynomial or welch. [auto]")] = None,
    resolution: Annotated[float | None, typer.Option(help="Of the spectra [Hz]. [0.25, or one over the period]")] = None,
    low: Annotated[float | None, typer.Option(help="Modes are looked for from here [Hz]. [4]")] = None,
    high: Annotated[float | None, typer.Option(help="To here [Hz]. [250, or 0.3 of the rate]")] = None,
    model: Annotated[str | None, typer.Option(help="model.json whose inertia is expected. [the controller's own]")] = None,
    posture: Annotated[list[str] | None, typer.Option(help="Postures to draw, by their numbers: 1,3. "
                                                             "[nearest to the two of Kostić et al. 2004]")] = None,
) -> None:
    """Measure frequency responses and classify compliance: base, joint, delay or none."""
    from pipelines.frf import STAGE

    go(STAGE, tuple(logs or ()), common, {
        "estimator": estimator, "resolution": resolution, "low": low, "high": high, "model": model,
        "postures": whole_numbers(posture, "--posture")}, roles=roles)
