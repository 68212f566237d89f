"""One command per stage: parse, call, print. `rrrid_cli.main` starts them.

Heavy modules are imported inside the commands: `rrrid --help` answers at once.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines import __version__
from pipelines.errors import UsageError
from rrrid_cli.console import Teller, say_outcome
from rrrid_cli.options import Common, LogPaths, StageCommand, StageGroup, numbers, with_common

__all__ = ["STAGES", "app"]

TrustUnits = Annotated[bool | None, typer.Option("--trust-units", help="Radians are radians, however large they are.")]
Average = Annotated[bool | None, typer.Option("--average/--no-average",
                                              help="Of a periodic log, take the mean of periods that are alike. [average]")]
AllowSame = Annotated[bool | None, typer.Option("--allow-same", help="One recording may be fitted and judged by.")]

STAGES = ("run", "inspect", "import", "convert", "fit-friction", "reconstruct", "estimate-bps", "simulate", "design-excitation",
          "validate-writing", "frf", "diagnose", "extend")

app = typer.Typer(name="rrrid", cls=StageGroup, no_args_is_help=True, add_completion=False,
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
    """What holds for every command."""


@app.command(cls=StageCommand)
@with_common
def run(
    logs: LogPaths, common: Common,
    skip: Annotated[list[str] | None, typer.Option(help="Stage to leave out, such as diagnose. Repeatable.")] = None,
) -> None:
    """Do the whole workflow on a folder of logs; one report."""
    from pipelines.run import STAGE

    _go(STAGE, tuple(logs), common, {"skip": tuple(skip or ()) or None})


@app.command(cls=StageCommand)
@with_common
def inspect(
    logs: LogPaths, common: Common, trust_units: TrustUnits = None,
    allow_same: AllowSame = None,
) -> None:
    """The log doctor: check container, units, time and signals; nothing is changed."""
    from pipelines.inspect import STAGE

    _go(STAGE, tuple(logs), common, {"trust_units": trust_units, "allow_same": allow_same})


@app.command("import", cls=StageCommand)
@with_common
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
    """Make logs of recordings (CSV, MAT, NPY) by a recipe."""
    if guess is not None:
        _guess(guess, common)
        return
    if recipe is None:
        raise UsageError("C02", "no recipe", where="import", remedy="name a recipe, or draft one with --guess FILE")
    from pipelines.import_log import STAGE

    _go(STAGE, (), common, {"recipe": recipe, "source": source, "map": tuple(map or ()) or None, "trust_units": trust_units})


@app.command(cls=StageCommand)
@with_common
def convert(
    logs: LogPaths, common: Common,
    to: Annotated[str | None, typer.Option(help="h5, parquet or csv; goes before --format. [what the log is not in]")] = None,
) -> None:
    """Convert logs from HDF5 to Parquet and back, or to flat CSV."""
    from pipelines.convert import STAGE

    _go(STAGE, tuple(logs), common, {"to": to}, {"to": common.format})


@app.command("fit-friction", cls=StageCommand)
@with_common
def fit_friction(
    logs: LogPaths, common: Common,
    law: Annotated[str | None, typer.Option(help="Law to fit, as the ladder names it. [the simplest that is not worse]")] = None,
    method: Annotated[str | None, typer.Option(help="varpro, output-error, or ekf (the paper's). [varpro]")] = None,
    window: Annotated[float | None, typer.Option(help="Windows of the equations [s]. [0.02]")] = None,
) -> None:
    """Fit the friction law of each joint that was driven alone, and choose it."""
    from pipelines.fit_friction import STAGE

    _go(STAGE, tuple(logs), common, {"law": law, "method": method, "window": window})


@app.command(cls=StageCommand)
@with_common
def reconstruct(
    logs: LogPaths, common: Common,
    method: Annotated[str | None, typer.Option(help="smoother, observer, zero-phase or central-differences. [smoother]")] = None,
    order: Annotated[int | None, typer.Option(help="Integrators of the observer's model: 2, 3 (the paper's) or 4. [4]")] = None,
    jerk_std: Annotated[list[str] | None, typer.Option(help="Jerk [rad/s^order]: one, or one a joint. [as data say]")] = None,
    bandwidth: Annotated[list[str] | None, typer.Option(help="Bandwidth [Hz], instead of jerk: one, or one a joint.")] = None,
    average: Average = None,
) -> None:
    """Reconstruct position, speed and acceleration from the encoders: Kalman observer and smoother."""
    from pipelines.reconstruct import STAGE

    _go(STAGE, tuple(logs), common, {"method": method, "order": order, "jerk_std": numbers(jerk_std, "--jerk-std"),
                                     "bandwidth": numbers(bandwidth, "--bandwidth"), "average": average})


@app.command("estimate-bps", cls=StageCommand)
@with_common
def estimate_bps(
    logs: LogPaths, common: Common,
    method: Annotated[str | None, typer.Option(help="Motion by smoother, observer, zero-phase or central-differences.")] = None,
    order: Annotated[int | None, typer.Option(help="Integrators of the observer's model: 2, 3 (the paper's) or 4. [4]")] = None,
    jerk_std: Annotated[list[str] | None, typer.Option(help="Jerk [rad/s^order]: one, or one a joint. [as data say]")] = None,
    bandwidth: Annotated[list[str] | None, typer.Option(help="Bandwidth [Hz], instead of jerk: one, or one a joint.")] = None,
    average: Average = None,
    filter: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [from the motion]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [four a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    symmetric: Annotated[bool | None, typer.Option("--symmetric", help="RRR arm, mirror-symmetric links: p4 = p15 = 0.")] = None,
    unweighted: Annotated[bool, typer.Option("--unweighted", help="Weigh all joints alike, as eq. (15).")] = False,
    model: Annotated[str | None, typer.Option(help="model.json whose friction is subtracted, not fitted.")] = None,
    allow_same: AllowSame = None,
    allow_mismatch: Annotated[bool | None, typer.Option("--allow-mismatch", help="Fit torque that looks misplaced.")] = None,
) -> None:
    """Estimate base parameters and friction by least squares, with their uncertainty."""
    from pipelines.estimate_bps import STAGE

    _go(STAGE, tuple(logs), common, {
        "method": method, "order": order, "jerk_std": numbers(jerk_std, "--jerk-std"),
        "bandwidth": numbers(bandwidth, "--bandwidth"), "average": average, "filter": filter,
        "decimate": decimate, "min_speed": numbers(min_speed, "--min-speed"), "blocks": blocks,
        "symmetric": symmetric, "weighted": False if unweighted else None, "model": model, "allow_same": allow_same,
        "allow_mismatch": allow_mismatch,
        "compare": False if common.no_report else None})


@app.command(cls=StageCommand)
@with_common
def simulate(
    common: Common,
    model: Annotated[str, typer.Argument(help="The model.json of estimate-bps, or the shipped 'rrr'.", show_default=False)],
    like: Annotated[list[Path] | None, typer.Option(readable=False, help="Log to imitate, or a folder. Repeatable.")] = None,
    fault: Annotated[list[str] | None, typer.Option(
        help="CAUSE:JOINT:NAME=VALUE,…: quadratic_drag:2:coefficient=0.1. Repeatable. A wrong CAUSE "
             "or NAME is refused with a list of the right ones.")] = None,
    replicas: Annotated[int | None, typer.Option(help="Simulations that differ in their noise; windows have one. [1]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first one's noise. [1]")] = None,
    noise: Annotated[list[str] | None, typer.Option(
        help="Torque noise of the drives, std [N m], one or one a joint: 0.02,0.01,0.005. Windows have none. [0]")] = None,
    windowed: Annotated[bool | None, typer.Option("--windowed", help="In short windows, though the controller is known.")] = None,
    window: Annotated[float | None, typer.Option(help="Length of such a window [s]. [0.1]")] = None,
    steps: Annotated[int | None, typer.Option(help="Integrator steps a sample. [as few as the error allows]")] = None,
) -> None:
    """Simulate a model as a log's experiment would have it, optionally with a fault."""
    from pipelines.simulate import STAGE

    _go(STAGE, tuple(like or ()), common, {
        "model": model, "fault": tuple(fault or ()) or None, "replicas": replicas, "seed": seed,
        "noise": numbers(noise, "--noise"), "windowed": windowed, "window": window, "steps": steps})


@app.command("design-excitation", cls=StageCommand)
@with_common
def design_excitation(
    common: Common,
    name: Annotated[str | None, typer.Argument(metavar="ROBOT", show_default=False,
                                               help="A description, a URDF or a shipped name. [robot.toml here, else rrr]")] = None,
    purpose: Annotated[str | None, typer.Option("--for", help="excitation, friction, frf or hold. [excitation]")] = None,
    criterion: Annotated[str | None, typer.Option(help="default (A with condition 3), condition, frobenius, E, D or A.")] = None,
    cond_max: Annotated[float | None, typer.Option(help="Ceiling on the condition number. [default: 3]")] = None,
    harmonics: Annotated[list[str] | None, typer.Option(help="Harmonics: one number, or one a joint.")] = None,
    frequency: Annotated[list[str] | None, typer.Option(help="Fundamental [Hz]: one, or one a joint. [0.1]")] = None,
    keep_out: Annotated[list[str] | None, typer.Option(help="Bands without harmonics [Hz]: 4,6 or 4,6,11,13.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Time to search, in seconds of computing. [30]")] = None,
    evaluations: Annotated[int | None, typer.Option(help="Search so many evaluations instead: repeatable exactly.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the search. [1]")] = None,
    symmetric: Annotated[bool | None, typer.Option("--symmetric", help="Mirror-symmetric links: p4 = p15 = 0.")] = None,
    model: Annotated[str | None, typer.Option(help="Model that predicts torque. [the described links]")] = None,
    bounds: Annotated[str | None, typer.Option(help="Bounds on the parameters (TOML), where no model is known.")] = None,
    after: Annotated[list[Path] | None, typer.Option(readable=False, help="Earlier logs, or a result of frf. Repeatable.")] = None,
    home: Annotated[list[str] | None, typer.Option(help="Posture to start from [rad], one a joint: 0,-1.57,0.")] = None,
    no_rest: Annotated[bool, typer.Option("--no-rest", help="In motion at both ends, with run-in and run-out.")] = False,
    periods: Annotated[int | None, typer.Option(help="How often the period is repeated. [1]")] = None,
    friction: Annotated[bool | None, typer.Option("--friction/--no-friction", help="Count columns of friction as well.")] = None,
    random: Annotated[bool | None, typer.Option("--random", help="frf: random noise in the place of odd multisines.")] = None,
    tip_speed: Annotated[float | None, typer.Option(help="Limit on the speed of the tip [m/s].")] = None,
    tip_box: Annotated[list[str] | None, typer.Option(help="Box for the tip [m]: x from,to, y from,to, z from,to.")] = None,
    recipe: Annotated[str | None, typer.Option(help="Recipe of import: controller.csv in its order, units and rate.")] = None,
    tell_apart: Annotated[tuple[str, str] | None, typer.Option(
        metavar="CAUSE CAUSE", help="Two causes that the motion shall tell apart: spring:2 cogging:2:order=1.")] = None,
) -> None:
    """Design the excitation, or another experiment, that tells most within the robot's limits."""
    from pipelines.design_excitation import STAGE
    from rrrid_cli.options import whole_numbers

    _go(STAGE, tuple(after or ()), common, {
        "robot": name, "purpose": purpose, "criterion": criterion, "cond_max": cond_max,
        "harmonics": whole_numbers(harmonics, "--harmonics"), "frequency": numbers(frequency, "--frequency"),
        "keep_out": numbers(keep_out, "--keep-out"), "seconds": seconds, "evaluations": evaluations, "seed": seed,
        "symmetric": symmetric, "model": model, "bounds": bounds, "home": numbers(home, "--home"),
        "rest": False if no_rest else None, "periods": periods, "friction": friction, "random": random, "tip_speed": tip_speed,
        "tip_box": numbers(tip_box, "--tip-box"), "recipe": recipe, "tell_apart": tell_apart})


@app.command("validate-writing", cls=StageCommand)
@with_common
def validate_writing(
    common: Common,
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

    _go(STAGE, tuple(logs or ()), common, {
        "model": model, "torque_gate": torque_gate, "draws": draws, "seed": seed, "simulate": False if no_simulation else None,
        "text": text, "plane_y": plane_y, "x": x, "z": z, "size": size, "speed": speed, "slow": slow,
        "acceleration": acceleration, "elbow": elbow,
        "posture": numbers(posture, "--posture"), "via_points": via_points, "recipe": recipe})


@app.command(cls=StageCommand)
@with_common
def frf(
    logs: LogPaths, common: Common,
    estimator: Annotated[str | None, typer.Option(help="auto, multisine, local-polynomial or welch. [auto]")] = None,
    resolution: Annotated[float | None, typer.Option(help="Of the spectra [Hz]. [0.25, or one over the period]")] = None,
    low: Annotated[float | None, typer.Option(help="Modes are looked for from here [Hz]. [4]")] = None,
    high: Annotated[float | None, typer.Option(help="To here [Hz]. [250, or 0.3 of the rate]")] = None,
    model: Annotated[str | None, typer.Option(help="model.json whose inertia is expected. [the controller's own]")] = None,
    posture: Annotated[list[str] | None, typer.Option(help="Postures to draw, by their numbers: 1,3. [the paper's two]")] = None,
) -> None:
    """Measure frequency responses, and say what gives way: base, joint, delay, or nothing."""
    from pipelines.frf import STAGE
    from rrrid_cli.options import whole_numbers

    _go(STAGE, tuple(logs), common, {
        "estimator": estimator, "resolution": resolution, "low": low, "high": high, "model": model,
        "postures": whole_numbers(posture, "--posture")})


@app.command(cls=StageCommand)
@with_common
def diagnose(
    common: Common,
    logs: Annotated[list[Path] | None, typer.Argument(help="Logs, or folders of logs.", show_default=False, metavar="LOGS",
                                                      readable=False)] = None,
    identify: Annotated[list[str] | None, typer.Option(help="Logs to fit, whatever they say of themselves. Repeatable.")] = None,
    validate: Annotated[list[str] | None, typer.Option(help="Logs that judge. Repeatable.")] = None,
    reference: Annotated[list[str] | None, typer.Option(help="Logs of the arm as it was before. Repeatable.")] = None,
    without: Annotated[list[str] | None, typer.Option(help="Cause that it is not, you know: cogging. Repeatable.")] = None,
    model: Annotated[str | None, typer.Option(help="model.json whose friction laws are taken. [Coulomb and viscous]")] = None,
    replicas: Annotated[int | None, typer.Option(help="Simulated twins that say what is normal; 0: none. [10]")] = None,
    most: Annotated[int | None, typer.Option(help="Causes to look for, at most. [4]")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    filter: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [from the motion]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [four a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the twins' noise. [1]")] = None,
    allow_mismatch: Annotated[bool | None, typer.Option("--allow-mismatch", help="Diagnose torque that looks misplaced.")] = None,
) -> None:
    """Say what the simulation gets wrong, why, what to check, and how much better the model becomes."""
    from pipelines.diagnose import STAGE

    _go(STAGE, tuple(logs or ()), common, {
        "identify": tuple(identify or ()) or None, "validate": tuple(validate or ()) or None,
        "reference": tuple(reference or ()) or None, "without": tuple(without or ()) or None, "model": model,
        "replicas": replicas, "most": most, "blocks": blocks, "filter": filter, "decimate": decimate,
        "min_speed": numbers(min_speed, "--min-speed"), "seed": seed, "allow_mismatch": allow_mismatch})


@app.command(cls=StageCommand)
@with_common
def extend(
    common: Common,
    logs: Annotated[list[Path] | None, typer.Argument(help="Logs, or folders of logs.", show_default=False, metavar="LOGS",
                                                      readable=False)] = None,
    with_: Annotated[list[str] | None, typer.Option("--with", help="CAUSE:JOINT, or CAUSE:JOINT:NAME=VALUE with a start for a "
                                                    "non-linear number: cogging:2:order=18. Repeatable.")] = None,
    identify: Annotated[list[str] | None, typer.Option(help="Logs to fit, whatever they say of themselves. Repeatable.")] = None,
    validate: Annotated[list[str] | None, typer.Option(help="Logs that judge. Repeatable.")] = None,
    reference: Annotated[list[str] | None, typer.Option(help="Logs of the arm as it was before. Repeatable.")] = None,
    model: Annotated[str | None, typer.Option(help="model.json to extend: its effects are kept, and fitted anew.")] = None,
    blocks: Annotated[int | None, typer.Option(help="Blocks held out in turn where no log is validate. [10]")] = None,
    filter: Annotated[float | None, typer.Option(help="Low-pass over torque and columns [Hz]. [from the motion]")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every Nth sample. [four a period of the low-pass]")] = None,
    min_speed: Annotated[list[str] | None, typer.Option(help="Leave slower samples out [rad/s]: one, or one a joint. [0]")] = None,
    allow_mismatch: Annotated[bool | None, typer.Option("--allow-mismatch", help="Fit torque that looks misplaced.")] = None,
) -> None:
    """Extend the model by named causes, refit everything, and judge it on held-out logs."""
    from pipelines.extend import STAGE

    _go(STAGE, tuple(logs or ()), common, {
        "causes": tuple(with_ or ()) or None, "identify": tuple(identify or ()) or None,
        "validate": tuple(validate or ()) or None, "reference": tuple(reference or ()) or None, "model": model, "blocks": blocks,
        "filter": filter, "decimate": decimate, "min_speed": numbers(min_speed, "--min-speed"), "allow_mismatch": allow_mismatch})


@app.command()
def schema(what: Annotated[str, typer.Argument(help="model")] = "model") -> None:
    """Print the JSON schema of what rrrid writes."""
    from pipelines.log.model_file import model_schema
    from pipelines.log.results import json_text

    if what != "model":
        raise UsageError("C02", f"no schema of '{what}'", where="schema", remedy="one of: model")
    sys.stdout.write(json_text(model_schema()))


def _guess(path: Path, common: Common) -> None:
    from pipelines.log.recording.guess import guess_recipe

    drafted = guess_recipe(path)
    if common.out is not None:
        raise UsageError("C02", "--guess prints its draft", where="--out",
                         remedy="redirect it: rrrid import --guess FILE > recipe.toml")
    if common.json:
        from pipelines.log.results import encode, json_text

        sys.stdout.write(json_text(encode(drafted)[0]))
    else:
        sys.stdout.write(drafted.text)


def _go(stage: Any, paths: tuple[Path, ...], common: Common, given: dict[str, Any],
        fallback: dict[str, Any] | None = None) -> None:
    """Run one stage as the options say, print its outcome, and end with its exit code."""
    from pipelines.stage import Request, run_stage
    from rrrid_cli.settings import make_settings

    if common.format not in (None, "h5", "parquet"):
        raise UsageError("C02", f"'{common.format}' is no container", where="--format", remedy="give h5 or parquet")
    settings = make_settings(stage.settings, stage.name, STAGES, common.config, common.set, given, fallback)
    teller = Teller(common.quiet or common.json, common.verbose)
    request = Request(paths, common.out, common.robot, common.strict, common.check, common.force, common.no_report,
                      common.assume_units, common.format or "h5", teller, common.joints)
    try:
        outcome = run_stage(stage, request, settings)
    finally:
        teller.done()
    say_outcome(outcome, as_json=common.json, quiet=common.quiet, verbose=common.verbose)
    raise typer.Exit(outcome.exit_code)
