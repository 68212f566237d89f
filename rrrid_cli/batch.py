"""The command that runs another one on many folders: `rrrid batch ROOT`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.errors import UsageError
from rrrid_cli.console import Teller, say_outcome
from rrrid_cli.options import Common, StageCommand, with_common_but

__all__ = ["BatchCommand", "batch"]

_BYTES = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


class BatchCommand(StageCommand):
    """Its help ends in where the stages' own options stand."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        formatter.write_paragraph()
        formatter.write_text("--set STAGE.OPTION=VALUE and --config give the stage its options: 'rrrid STAGE --help' lists them.")


@with_common_but(out="runs/several/ROOT/batch")
def batch(
    root: Annotated[Path, typer.Argument(help="Folder with many folders of logs.", show_default=False, metavar="ROOT",
                                         readable=False)],
    common: Common,
    stage: Annotated[str, typer.Option(help="Command to run on each: run, estimate-bps, inspect, …")] = "run",
    each_log: Annotated[bool, typer.Option("--each-log", help="On each log, not on each folder that holds logs.")] = False,
    jobs: Annotated[int | None, typer.Option(help="Items at a time. [as many as there are cores]")] = None,
    timeout: Annotated[float | None, typer.Option(help="Time for one item [s]; then it has failed. [none]")] = None,
    memory: Annotated[str | None, typer.Option(help="Memory for one item: 500M, 2G; then it has failed. [none]")] = None,
    on_error: Annotated[str, typer.Option(help="continue or abort, where an item is rejected or fails.")] = "continue",
    resume: Annotated[bool, typer.Option("--resume", help="Do only what is unfinished, failed, rejected or changed.")] = False,
    shard: Annotated[str | None, typer.Option(help="I/N: every Nth item alone, from the Ith on. [all]")] = None,
    backend: Annotated[str, typer.Option(help="local, or dask://HOST:PORT: a Dask scheduler.")] = "local",
    baseline: Annotated[str | None, typer.Option(help="model.json that is known: only what goes beyond it is found.")] = None,
) -> None:
    """Run the whole workflow, or one stage, on every robot and day of many folders, in parallel."""
    from pipelines.batch.server import warm_up

    if backend == "local":
        warm_up(f"pipelines.{stage.replace('-', '_')}")
    from pipelines.batch.batch import Wanted, run_batch
    from pipelines.batch.items import read_shard
    from pipelines.batch.plan import Options, Plan, load_stage, module_of
    from rrrid_cli.commands import STAGES
    from rrrid_cli.settings import make_settings

    if common.format not in (None, "h5", "parquet"):
        raise UsageError("C02", f"'{common.format}' is no container", where="--format", remedy="give h5 or parquet")
    if on_error not in ("continue", "abort"):
        raise UsageError("C02", f"'{on_error}' is neither", where="--on-error", remedy="give continue or abort")
    settings = make_settings(load_stage(module_of(stage)).settings, stage, STAGES, common.config, common.set, {})
    options = Options(common.robot, common.strict, common.force, common.no_report, common.assume_units, common.format or "h5",
                      common.joints, _memory(memory), _positive(timeout, "--timeout"))
    teller = Teller(common.quiet or common.json, common.verbose)
    wanted = Wanted(root, common.out, _jobs(jobs), each_log, "abort" if on_error == "abort" else "continue", resume,
                    read_shard(shard), backend, baseline, common.check, common.no_report, teller)
    try:
        outcome = run_batch(Plan(module_of(stage), settings, options), wanted)
    finally:
        teller.done()
    say_outcome(outcome, as_json=common.json, quiet=common.quiet, verbose=common.verbose)
    raise typer.Exit(outcome.exit_code)


def _jobs(jobs: int | None) -> int:
    if jobs is None:
        from pipelines.io.processors import processors

        return processors()
    if not 1 <= jobs <= 4096:
        raise UsageError("C02", f"{jobs} at a time", where="--jobs", remedy="give 1 or more")
    return jobs


def _positive(seconds: float | None, where: str) -> float | None:
    if seconds is not None and not 0.0 < seconds < 1e9:
        raise UsageError("C02", f"{seconds:g} is no time", where=where, remedy="give seconds, more than 0")
    return seconds


def _memory(text: str | None) -> int | None:
    """"2G" in bytes."""
    if text is None:
        return None
    number = text.strip().upper().removesuffix("B").removesuffix("I")
    unit = number[-1:] if number[-1:] in _BYTES else ""
    try:
        size = float(number.removesuffix(unit)) * _BYTES[unit]
    except ValueError:
        size = 0.0
    if not 1 << 20 <= size < 1 << 50:
        raise UsageError("C02", f"'{text}' is no amount of memory", where="--memory", remedy="write for example 500M or 2G")
    return int(size)
