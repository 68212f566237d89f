"""Waves along a joint's own angle, taken out of a residual: they are no noise, whether or not a cause of that shape is looked for.

    rest = without_waves(data, left)        (rows,) [N m]

Noise knows nothing of an angle. Where the residual of one log, summed up over the angle, has a line far above all others, it is
taken away, and the next, by matching pursuit (Mallat & Zhang 1993): as many as there may be harmonics of a ripple.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["without_waves"]

_MOST = 6  # of a joint in a log
_SHARE = 0.1  # of the squared residual, that a wave takes away at least
# Over the number of rows, the same: of white noise a wave with slopes takes about four over it, the strongest of a thousand 25.
_CHANCE = 40.0
_BINS, _FINE = 2048, 4  # along the range of the joint; orders a wave over it
_LEAST, _HIGHEST = 2, 256  # waves over the range: slower ones are no line, faster ones are blurred by the bins


def without_waves(data: Data, left: Array) -> Array:
    """`left` (rows,) [N m] without the waves that stand out in it, log by log and joint by joint."""
    parts = []
    for one, rows in zip(data.logs, data.split(left), strict=True):
        q = one.at_rows(one.motion.q)
        parts += [_rest(q[:, j], rows[j]) for j in range(data.n_joints)]
    return np.concatenate(parts)


def _rest(q: Array, x: Array) -> Array:
    span = float(np.ptp(q)) if len(q) else 0.0
    if span <= 0.0:
        return x
    place = np.minimum((_BINS * (q - q.min()) / span).astype(int), _BINS - 1)
    share = max(_SHARE, _CHANCE / len(x))
    for _ in range(_MOST):
        # X(m) = Σ_n x_n exp(-2πi m (q_n - q_min) / (4 span)): bins first, which a fast transform then sums
        lines = np.abs(np.fft.rfft(np.bincount(place, x, minlength=_BINS), n=_FINE * _BINS))[:_FINE * _HIGHEST]
        best = _FINE * _LEAST + int(np.argmax(lines[_FINE * _LEAST:]))
        angle = 2.0 * np.pi * best / (_FINE * span) * q
        wave = np.stack([np.sin(angle), np.cos(angle)])
        wave = np.concatenate([wave, (q - q.mean()) * wave])  # slopes: its order lies between two lines
        less = x - np.linalg.lstsq(wave.T, x, rcond=None)[0] @ wave
        if less @ less > (1.0 - share) * (x @ x):
            break
        x = less
    return x
