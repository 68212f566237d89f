"""A stretch of a log without a gap: how a signal over it becomes rows, in the frequency domain.

    run = run_of(equations, part)
    run.lay(x), run.lay_command(tau)        (channels, samples) -> (channels, rows)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.estimation.regression import LogEquations
from pipelines.signal.filters import passed_both_ways, thinned

__all__ = ["PAD", "Run", "quick_size", "run_of"]

Indices = npt.NDArray[np.intp]

PAD = 4.0  # periods of the cut-off a stretch is continued by
_AT_ONCE = 8  # channels, which stay near the processor
_END = 1.0  # periods of the cut-off left out at either end of a stretch


@dataclass(frozen=True, eq=False)
class Run:
    """A stretch without a gap: what is done to a signal of it, in the frequency domain."""

    held: bool  # the torque is a held command: columns are averaged as it is
    response: Array  # (bins,) low-pass, at the frequencies of the padded stretch, as far as the thinned rows go
    average: Array  # (bins,) of the average over two samples of a smooth signal
    size: int  # of the padded stretch
    pad: int  # a multiple of `every`
    every: int
    chosen: Indices  # places in the thinned stretch that become rows

    def lay(self, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """A smooth signal (channels, samples) -> (channels, rows)."""
        return self._through(x, self.response * self.average if self.held else self.response)

    def lay_command(self, tau: Array) -> Array:
        """The same of the torque (joints, samples): of a held command ½ (u_k + u_{k-1}) is its average."""
        if self.held:
            tau = 0.5 * (tau + np.concatenate([tau[:, :1], tau[:, :-1]], axis=1))
        return self._through(tau, self.response)

    def _through(self, x: npt.NDArray[Any], response: Array) -> npt.NDArray[Any]:
        pad, end, out = self.pad, x.shape[1] + self.pad, np.empty((len(x), len(self.chosen)), x.dtype)
        wide, places = np.zeros((min(len(x), _AT_ONCE), self.size), x.dtype), self.chosen + pad // self.every
        for first in range(0, len(x), _AT_ONCE):
            some = x[first:first + _AT_ONCE]
            table = wide[:len(some)]
            table[:, pad:end] = some
            np.subtract(2.0 * some[:, :1], some[:, pad:0:-1], out=table[:, :pad])
            np.subtract(2.0 * some[:, -1:], some[:, -2:-pad - 2:-1], out=table[:, end:end + pad])
            out[first:first + _AT_ONCE] = thinned(table, response, self.every)[:, places]
        return out


def run_of(equations: LogEquations, part: slice, skip: int = 1) -> Run:
    how, held = equations.conditioning, equations.held
    rate, every = 1.0 / equations.found.good.log.sample_time, how.decimation
    n = part.stop - part.start
    cutoff = how.cutoff_hz
    reach = 2 if cutoff is None else int(np.ceil(_END * rate / cutoff))
    chosen = np.arange(-(-min(reach, n // 4) // every), (n - min(reach, n // 4)) // every)
    chosen = chosen[~equations.rows.out[part][chosen * every]]
    pad = every * (min(n - 2, 16 if cutoff is None else int(np.ceil(PAD * rate / cutoff))) // every)
    size = 2 * every * quick_size(-(-(n + 2 * pad) // (2 * every)))
    bins = np.arange(size // 2 // every + 1)
    turn = 2.0 * np.pi * bins / size
    response = np.ones(len(bins)) if cutoff is None else passed_both_ways(bins * rate / size, cutoff, rate)
    average = (114.0 + 68.0 * np.cos(turn) - 2.0 * np.cos(2.0 * turn)) / 180.0
    return Run(held, response, average, size // skip, pad // skip, every // skip, chosen)


def quick_size(n: int) -> int:
    """The smallest 2^a 3^b 5^c from n on: lengths of a quick Fourier transform."""
    best = 1 << max(0, (n - 1).bit_length())
    for five in range(8):
        for three in range(12):
            odd = 5**five * 3**three
            if odd >= best:
                break
            size = odd << max(0, int(np.ceil(np.log2(max(n / odd, 1.0)))))
            if n <= size < best:
                best = size
    return best
