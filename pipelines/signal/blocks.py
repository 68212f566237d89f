"""Run a linear recursion over many samples in blocks: two matrix products and a logarithmic carry instead of a loop.

x_{k+1} = A x_k + b u_k, cut into blocks of B samples. Within a block everything is one small matrix applied to the B
inputs and the state at its start; between blocks x_{b+1} = A^B x_b + s_b is a recursion over N / B states, solved by
doubling (Hillis & Steele 1986, "Data parallel algorithms", p. 1173), which ends as soon as A^(B 2^j) has died out.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["impulse_toeplitz", "powers", "scan"]

Array = npt.NDArray[np.float64]


def powers(a: Array, count: int) -> Array:
    """A^0 .. A^count, (joints, count + 1, n, n), by doubling."""
    joints, n, _ = a.shape
    out = np.empty((joints, count + 1, n, n))
    out[:, 0] = np.eye(n)
    known, top = 1, a
    while known <= count:
        more = min(known, count + 1 - known)
        np.matmul(out[:, :more], top[:, None], out=out[:, known:known + more])
        top = top @ top
        known += more
    return out


def scan(m: Array, drive: Array) -> Array:
    """x_0 = drive_0, x_{b+1} = M x_b + drive_{b+1}, in place: `m` (joints, n, n), `drive` (joints, blocks, n)."""
    blocks, reach, shift = drive.shape[1], m.swapaxes(1, 2), 1
    while shift < blocks and float(np.abs(reach).max()) > 1e-22:
        drive[:, shift:] += drive[:, :-shift] @ reach
        reach = reach @ reach
        shift *= 2
    return drive


def impulse_toeplitz(h: Array) -> Array:
    """The matrix of a causal impulse response: entry [j, i] = h[i - j], what input j does to output i. (..., B) → (..., B, B)."""
    size = h.shape[-1]
    lag = np.arange(size) - np.arange(size)[:, None]
    return np.where(lag >= 0, h[..., np.maximum(lag, 0)], 0.0)
