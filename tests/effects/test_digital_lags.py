"""A lag that is computed once a sample acts half a sample sooner; SciPy filters the samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pipelines.dynamics.body import Motion
from pipelines.effects.drives import DriveLag, TorqueLag
from tests.effects.on_bench import arm as described

_H, _T = 1e-3, 5e-3  # [s] sample time, time constant


@pytest.mark.parametrize("every", [1, 2], ids=["each sample", "every other sample"])
def test_a_digital_filter_is_met_on_all_samples_and_on_some(every: int) -> None:
    """Commands of up to 10 Hz, filtered by y_k = a y_{k-1} + (1 - a) u_k: to 2e-3, where a continuous lag is off by 5e-3."""
    arm, t = described(), _H * np.arange(3000)
    command = np.column_stack([np.sin(2.0 * np.pi * f * t) for f in (2.0, 5.0, 10.0)])
    a = np.exp(-_H / _T)
    filtered = lfilter([1.0 - a], [1.0, -a], command, axis=0)
    zero = np.zeros_like(command[::every])
    motion, inner = Motion(t[::every], zero, zero, zero, log_sample_time=_H), slice(100, -5)
    for kind, before, behind in ((TorqueLag, command, filtered), (DriveLag, filtered, command)):
        for joint in (1, 2, 3):
            off = []
            for digital in (1.0, 0.0):
                values = {"time_constant": _T, "sample_time": digital * _H}
                found = kind(joint=joint).at(values).apply(motion, arm, values, lambda m, a, x=before: x[::every].copy())
                off.append(np.abs(found - behind[::every])[inner, joint - 1].max())
            assert off[0] < 2e-3 < 5e-3 < off[1]
