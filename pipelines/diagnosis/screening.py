"""Screening by the generalised likelihood ratio.

    T_c = gᵀ H⁻¹ g,  H = C Cᵀ - C Bᵀ P⁻¹ B Cᵀ,  P = A + B Bᵀ,  g = C r

with the prior information A, the columns B of nominal and standing numbers, the columns C of a
candidate and the residual r (Frisch & Waugh 1933, Lovell 1963, with a prior).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.candidates import Group
from pipelines.diagnosis.unnamed import Key
from pipelines.estimation.joint_table import Array, Arrow

__all__ = ["Screened", "best_of", "price", "screen"]

_VISIBLE = 1e-6  # numerics: eigenvalue of H in unit columns, below which a direction is absorbed


@dataclass(frozen=True)
class Screened:
    """The best shape of a cause at a joint."""

    group: Group
    gain: float  # T_c
    freedom: int
    amplitudes: Array


def screen(
    groups: Sequence[Group], info: Arrow, cross: Array, own: Sequence[Array], moments: Array
) -> list[Screened]:
    """Return T_c of every group.

    Args:
        info: P (k, k).
        cross: B Cᵀ (k, columns).
        own: C Cᵀ of each group.
        moments: g (columns,).
    """
    half = info.half(cross)
    out = []
    for group, square in zip(groups, own, strict=True):
        left = square - half[:, group.span].T @ half[:, group.span]
        unit = np.sqrt(np.maximum(np.diag(square), 1e-300))
        values, vectors = np.linalg.eigh(left / unit / unit[:, None])
        seen = values > _VISIBLE
        z = vectors[:, seen].T @ (moments[group.span] / unit)
        amplitudes = (vectors[:, seen] @ (z / values[seen])) / unit
        gain = float(np.sum(z**2 / values[seen]))
        found = Screened(group, gain, int(seen.sum()), amplitudes)
        if group.amplitude is not None:
            found = _at_amplitude(found, group.amplitude)
        elif group.sign * found.amplitudes[0] < 0.0:  # zero is its best amplitude
            found = replace(found, gain=0.0)
        out.append(found)
    return out


def _at_amplitude(one: Screened, known: float) -> Screened:
    """Return a candidate with the amplitude that its columns are exact for.

    The gain T_c = H a² falls by H (a - known)²: a lag of another length has other columns, and a
    gap another curve.
    """
    best = float(one.amplitudes[0])
    share = 1.0 - (1.0 - known / best) ** 2 if best > 0.0 else 0.0
    return replace(one, gain=max(one.gain * share, 0.0), amplitudes=np.array([known]))


def price(x: Array) -> float:
    """Return Σ ln(1 + x²): what numbers x cost, each of a row of its own, in units of the noise."""
    return float(np.sum(np.log1p(x**2)))


def best_of(screened: Iterable[Screened]) -> dict[Key, Screened]:
    """Return the best shape of each cause at each joint."""
    best: dict[Key, Screened] = {}
    for one in screened:
        key = one.group.key
        if key not in best or one.gain > best[key].gain:
            best[key] = one
    return best
