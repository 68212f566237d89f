"""Put samples taken at uneven times on an even grid.

The natural cubic spline through the samples is the noise-free limit of the smoother of an integrated Wiener process
(Wahba 1978, eq. (1.4)): what state-space smoothing gives when the measurements are believed. It therefore adds nothing
to the samples but the smoothest motion between them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

__all__ = ["grid", "resample", "through"]

Array = npt.NDArray[np.float64]


def grid(start: float, end: float, rate: float) -> Array:
    """Even time stamps from `start` on, `rate` a second, none after `end`. [s]"""
    # A millionth of a step of slack: 10 s at 400 Hz are 4001 samples, whatever the rounding of 10.0 * 400.
    count = int(np.floor((end - start) * rate + 1e-6)) + 1
    return start + np.arange(max(0, count)) / rate


def resample(t: Array, values: Array, at: Array, method: Literal["spline", "linear"] = "spline") -> Array:
    """`values` (samples,) or (samples, k), taken at the increasing times `t`, at the times `at` inside their span."""
    if method == "linear" or t.size < 4:
        return np.stack([np.interp(at, t, column) for column in np.atleast_2d(values.T)],
                        axis=-1).reshape(at.shape + values.shape[1:])
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, values, axis=0, bc_type="natural")(at), dtype=np.float64)


def through(at: Array, values: Array, wanted: Array) -> Array:
    """Cubic spline through `values` (samples, channels) at instants `at` (samples,), at the `wanted` ones (wanted, channels)."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(at, values)(wanted))
