"""Short searches for the tests of `design-excitation`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.design_excitation import STAGE, Settings
from pipelines.stage import Outcome, Request, run_stage

QUICK = replace(Settings(), robot="rrr", evaluations=150, harmonics=(15,))


def designed(out: Path, settings: Settings = QUICK, paths: tuple[Path, ...] = (), **request: Any) -> Outcome[Any]:
    return run_stage(STAGE, Request(paths, out=out, no_report=True, **request), settings)
