"""Compare a recorded torque with weight and inertia of the robot's own links.

    tau = a tau_links(q, dq, ddq) + F tanh(dq/v) + B dq + c

at each joint by least squares: a is 1 in N m on the joint side, in one unit of position only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.importers.config import GUESS
from pipelines.io.log import Array

# (samples, joints) q, dq, ddq [rad] -> torque [N m] of a robot's links
TorqueModel = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True)
class LinkFit:
    """The fit of a torque by the robot's links and friction."""

    gains: Array  # recorded torque per N m of the links, of joints where these matter
    unexplained: float  # share of the torque's variance, over all joints


def fit_links(model: TorqueModel, q: Array, t: Array, tau: Array) -> LinkFit | None:
    """Return the fit of `tau` by the links at positions `q` [rad]; None on an uneven clock."""
    step = float(np.median(np.diff(t)))
    width = max(GUESS.cubic, round(GUESS.window / step)) | 1
    if len(t) < 2 * width or np.abs(np.diff(t) / step - 1.0).max() > GUESS.uneven:
        return None
    # Local cubics in a window about each sample (Savitzky & Golay 1964): value and derivatives.
    powers = np.vander(np.linspace(-1.0, 1.0, width), 4)[:, ::-1]
    value, slope, curve, _ = np.linalg.pinv(powers)
    every, reach = slice(None, None, max(1, len(t) // GUESS.samples)), width // 2 * step
    windows = np.lib.stride_tricks.sliding_window_view
    around = windows(np.unwrap(q, axis=0), width, axis=0)[every]
    motion = around @ value, around @ slope / reach, around @ curve * 2.0 / reach**2
    links, tau = model(*motion), windows(tau, width, axis=0)[every] @ value
    if not np.isfinite(links).all():
        return None
    gains, rest = [], np.empty_like(tau)
    for j, (own, torque) in enumerate(zip(links.T, tau.T, strict=True)):
        speed = motion[1][:, j]
        slow = max(GUESS.slow * float(np.abs(speed).max()), 1e-300)
        friction = np.column_stack([np.tanh(speed / slow), speed, np.ones(len(speed))])
        columns = np.column_stack([own, friction])
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        numbers = np.linalg.lstsq(columns / scale, torque, rcond=None)[0] / scale
        rest[:, j] = torque - columns @ numbers
        without = torque - friction @ np.linalg.lstsq(friction, torque, rcond=None)[0]
        explained = rest[:, j].var() < (1.0 - GUESS.explains) * without.var()
        if explained and without.var() > GUESS.matters * torque.var():
            gains.append(numbers[0])
    share = rest.var(axis=0).sum() / max(float(tau.var(axis=0).sum()), 1e-300)
    return LinkFit(np.array(gains), float(share))
