"""Run the stage on logs of the test's own making."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipelines import estimate_bps
from pipelines.io.files import write_log
from pipelines.io.hdf5 import read_series
from pipelines.io.log import ExperimentLog
from pipelines.stage import Outcome, Request, run_stage

Result = estimate_bps.Result
Settings = estimate_bps.Settings
SYMMETRIC = Settings(symmetric=True)


def stage(folder: Path, *logs: ExperimentLog, settings: Settings = SYMMETRIC, check: bool = False,
          suffix: str = "h5") -> Outcome[Result]:
    for log in logs:
        write_log(folder / f"logs/{log.name}.{suffix}", log)
    request = Request((folder / "logs",), out=folder / "out", no_report=True, check=check)
    return run_stage(estimate_bps.STAGE, request, settings)


def contents(folder: Path) -> dict[str, object]:
    """What a run says: the result as printed, its series and the model, bit for bit."""
    series = read_series(folder / "result.h5")
    return {"result": (folder / "result.json").read_bytes(), "model": (folder / "model.json").read_bytes(),
            "series": {name: (np.asarray(values).dtype.str, np.asarray(values).tobytes()) for name, values in series.items()}}


def of_elbow(log: ExperimentLog) -> ExperimentLog:
    """A free motion: of an excitation every joint has to move, and an encoder that does not is dead, D04."""
    return replace(log, experiment="free")
