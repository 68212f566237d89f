"""Reconstruct motion; fit friction and base parameters."""

from __future__ import annotations

from typing import Annotated

import typer

from rrrid_cli.commands.application import app, go
from rrrid_cli.options import Common, LogPaths, Roles, SomeLogs, StageCommand, numbers, with_common

__all__ = ["estimate_bps", "fit_friction", "reconstruct"]


Average = Annotated[bool | None, typer.Option("--average/--no-average",
                                              help="Of a periodic log, take the mean of periods that are alike. [average]")]
AllowOverlap = Annotated[bool | None, typer.Option("--allow-overlap", help="One recording may be fitted and judged by.")]


@app.command("fit-friction", cls=StageCommand)
@with_common
def fit_friction(
    common: Common, roles: Roles, logs: SomeLogs = None,
    law: Annotated[str | None, typer.Option(help="Law to fit, as the report names it. [the simplest that is not worse]")] = None,
    method: Annotated[str | None, typer.Option(help="varpro, output-error, or ekf (Kostić et al. 2004). [varpro]")] = None,
    window: Annotated[float | None, typer.Option(help="Windows of the equations [s]. [0.02]")] = None,
) -> None:
    """Fit the friction law of each joint that was driven alone, and choose it."""
    from pipelines.fit_friction import STAGE

    go(STAGE, tuple(logs or ()), common, {"law": law, "method": method, "window": window}, roles=roles)


@app.command(cls=StageCommand)
@with_common
def reconstruct(
    logs: LogPaths, common: Common,
    method: Annotated[str | None, typer.Option(help="smoother, observer, zero-phase or central-differences. [smoother]")] = None,
    order: Annotated[int | None, typer.Option(help="Integrators in the observer: 2, 3 (Kostić et al. 2004) or 4. [4]")] = None,
    jerk_std: Annotated[list[str] | None, typer.Option(help="Jerk [rad/s^order]: one, or one a joint. [as data say]")] = None,
    bandwidth: Annotated[list[str] | None, typer.Option(help="Bandwidth [Hz], instead of jerk: one, or one a joint.")] = None,
    average: Average = None,
) -> None:
    """Reconstruct position, speed and acceleration from the encoders: Kalman observer and smoother."""
    from pipelines.reconstruct import STAGE

    go(STAGE, tuple(logs), common, {"method": method, "order": order, "jerk_std": numbers(jerk_std, "--jerk-std"),
                                     "bandwidth": numbers(bandwidth, "--bandwidth"), "average": average})


@app.command("estimate-bps", cls=StageCommand)
@with_common
def estimate_bps(
    common: Common, roles: Roles, logs: SomeLogs = None,
    method: Annotated[str | None, typer.Option(help="Motion by smoother, observer, zero-phase or central-differences.")] = None,
    order: Annotated[int | None, typer.Option(help="Integrators in the observer: 2, 3 (Kostić et al. 2004) or 4. [4]")] = None,
    jerk_std: Annotated[list[str] | None, typer.Option(help="Jerk [rad/s^order]: one, or one a joint. [as data say]")] = None,
    bandwidth: Annotated[list[str] | None, typer.Option(help="Bandwidth [Hz], instead of jerk: one, or one a joint.")] = None,
    average: Average = None,
    cutoff_hz: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [from the motion]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [four a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    symmetric: Annotated[bool | None, typer.Option("--symmetric", help="RRR arm, mirror-symmetric links: p4 = p15 = 0.")] = None,
    unweighted: Annotated[bool, typer.Option("--unweighted", help="Weigh all joints alike, as Kostić et al. 2004.")] = False,
    model: Annotated[str | None, typer.Option(help="model.json whose friction is subtracted, not fitted.")] = None,
    allow_overlap: AllowOverlap = None,
    skip_sanity_checks: Annotated[bool | None, typer.Option("--skip-sanity-checks",
                                                            help="Fit torque that fails its checks.")] = None,
) -> None:
    """Estimate base parameters and friction by least squares, with their uncertainty."""
    from pipelines.estimate_bps import STAGE

    go(STAGE, tuple(logs or ()), common, {
        "method": method, "order": order, "jerk_std": numbers(jerk_std, "--jerk-std"),
        "bandwidth": numbers(bandwidth, "--bandwidth"), "average": average, "cutoff_hz": cutoff_hz,
        "decimate": decimate, "min_speed": numbers(min_speed, "--min-speed"), "blocks": blocks,
        "symmetric": symmetric, "weighted": False if unweighted else None, "model": model, "allow_overlap": allow_overlap,
        "skip_sanity_checks": skip_sanity_checks,
        "compare": False if common.no_report else None}, roles=roles)
