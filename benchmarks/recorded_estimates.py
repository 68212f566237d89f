"""Measure `estimate-bps` on two recorded robots, on fixed rows and by its own: panda and kr300.

    python -m benchmarks.recorded_estimates ../shared/real

Fixed rows: the torque of the model and of the log through a zero-phase low-pass of 10 Hz, all
samples but the cuts of the README of the logs, regardless of the program's own filter and rows.
Of kr300 each log is held out once, and the mean is quoted.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt

from pipelines.estimate_bps import Settings, compute
from pipelines.estimation.result import Result
from pipelines.io.files import open_log
from pipelines.stage import Inputs

_CUTOFF_HZ = 10.0
_CUT = {"panda": 0.0, "kr300": 1.5}  # [s] at both ends, as the READMEs say


def panda(real: Path, settings: Settings | None = None) -> Result:
    """Estimate from panda-a, judged by panda-b."""
    return _estimated(sorted((real / "panda/logs").glob("*.h5")), settings, "panda-b")


def kr300(real: Path, settings: Settings | None = None) -> list[Result]:
    """Estimate from two logs, judged by the third, three times."""
    paths = sorted((real / "kr300/logs").glob("*.h5"))
    return [_estimated(paths, settings, path.stem) for path in paths]


def fixed_row_error(result: Result, cut: float) -> float:
    """Return the relative torque error of the validation logs on fixed rows."""
    rest = total = 0.0
    for _, log in result.derived:
        if log.role != "validate":
            continue
        t = log.t[0] + log.sample_time * np.arange(int((log.t[-1] - log.t[0]) / log.sample_time))
        both = np.hstack([log.tau, log["tau_model"]])
        even = np.stack([np.interp(t, log.t, column) for column in both.T], axis=1)
        b, a = butter(4, 2.0 * _CUTOFF_HZ * log.sample_time)
        inside = (t >= t[0] + cut) & (t <= t[-1] - cut)
        tau, model = np.split(filtfilt(b, a, even, axis=0)[inside], 2, axis=1)
        rest, total = rest + float(np.sum((tau - model) ** 2)), total + float(np.sum(tau**2))
    return float(np.sqrt(rest / total))


def _estimated(paths: list[Path], settings: Settings | None, held_out: str) -> Result:
    opened = []
    for path in paths:
        one = open_log(path)
        role = "validate" if path.stem == held_out else "identify"
        opened.append(replace(one, log=replace(one.log, role=role)))
    return compute(Inputs(tuple(opened), (), (), None), settings or Settings())


def main(real: Path) -> None:
    """Print a line for each set and setting."""
    for label, settings in (
        ("defaults", Settings()),
        ("--cutoff-hz 10", Settings(cutoff_hz=_CUTOFF_HZ)),
    ):
        for name, results in (("panda", [panda(real, settings)]), ("kr300", kr300(real, settings))):
            own = [100 * one.relative_error["validate"] for one in results]
            fixed = [100 * fixed_row_error(one, _CUT[name]) for one in results]
            print(
                f"{name:6} {label:12} own rows {np.mean(own):.2f} % {np.round(own, 2)}, "
                f"fixed rows {np.mean(fixed):.2f} % {np.round(fixed, 2)}, "
                f"low-pass {results[0].filter_hz} Hz"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
