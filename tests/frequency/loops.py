"""A plant of known modes in a sampled loop, for tests: the truth is what scipy.signal makes of the same equations.

    P(s) = rigid / s² + Σ residue / (s² + 2 ζ ω s + ω²),   held and sampled;   r = v - C(z) q,   C = kp + kd (1 - z⁻¹) / T
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal

from pipelines.frequency.spectra import Responses, cross_spectra

T = 1e-3  # [s]


def welch_responses(stretches: Sequence[np.ndarray], rate: float, segment: int, source: int = 0,
                    outputs: Sequence[int] = (1, 2)) -> Responses:
    """From channel `source` to `outputs`, by averaged segments."""
    return cross_spectra(stretches, rate, segment).responses(source, outputs)


@dataclass(frozen=True)
class Plant:
    """Modes as (frequency [Hz], damping ratio, residue); residues of one sign with `rigid` give an antiresonance each."""

    modes: tuple[tuple[float, float, float], ...]
    rigid: float = 1.0

    def state_space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Continuous A, B, C of the sum."""
        blocks, gains = [np.array([[0.0, 1.0], [0.0, 0.0]])], [self.rigid]
        for hertz, damping, residue in self.modes:
            w = 2.0 * np.pi * hertz
            blocks.append(np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]]))
            gains.append(residue)
        b = np.tile([0.0, 1.0], len(gains))[:, None]
        return linalg.block_diag(*blocks), b, np.repeat(gains, 2)[None] * np.tile([1.0, 0.0], len(gains))

    def sampled(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, b, c = self.state_space()
        return signal.cont2discrete((a, b, c, np.zeros((1, 1))), T)[:3]

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Of the held and sampled plant, as scipy has it."""
        a, b, c = self.sampled()
        z = np.exp(2j * np.pi * frequency * T)
        return np.array([(c @ np.linalg.solve(one * np.eye(len(a)) - a, b))[0, 0] for one in z])

    def antiresonances(self) -> list[tuple[float, float]]:
        """Frequency [Hz] and damping of the zeros, from the polynomial of the sum."""
        sections = [np.array([1.0, 2.0 * z * 2.0 * np.pi * f, (2.0 * np.pi * f) ** 2]) for f, z, _ in self.modes]
        whole = self.rigid * _product(sections)
        for k, (_, _, residue) in enumerate(self.modes):
            rest = _product([s for j, s in enumerate(sections) if j != k])
            whole = np.polyadd(whole, np.polymul([residue, 0.0, 0.0], rest))
        roots = [r for r in np.roots(whole) if r.imag > 0.0]
        return sorted((abs(r) / (2.0 * np.pi), -r.real / abs(r)) for r in roots)


def _product(sections: list[np.ndarray]) -> np.ndarray:
    whole = np.array([1.0])
    for one in sections:
        whole = np.polymul(whole, one)
    return whole


def controller(frequency: np.ndarray, kp: float, kd: float) -> np.ndarray:
    return kp + kd * (1.0 - np.exp(-2j * np.pi * frequency * T)) / T


def closed_loop_record(plant: Plant, v: np.ndarray, d: np.ndarray, n: np.ndarray, kp: float, kd: float) -> np.ndarray:
    """v, r, q (samples, 3) with disturbance d at the plant's input and noise n on q, from rest."""
    a, b, c = plant.sampled()
    size, k0, k1 = len(a), kp + kd / T, kd / T
    # states x and the q of the sample before; r = v - k0 (C x + n) + k1 q₋₁
    loop = np.block([[a - k0 * b @ c, k1 * b], [c, np.zeros((1, 1))]])
    drive = np.zeros((size + 1, 2))
    drive[:size, 0], drive[size, 1] = b[:, 0], 1.0
    values, vectors = np.linalg.eig(loop)
    inputs = np.linalg.solve(vectors, drive.astype(complex)) @ np.stack([v + d - k0 * n, n])
    modal = np.stack([signal.lfilter([0.0, 1.0], [1.0, -value], u) for value, u in zip(values, inputs, strict=True)])
    x = (vectors @ modal).real
    q = (c @ x[:size])[0] + n
    r = v - k0 * q + k1 * x[size]
    return np.stack([v, r, q], axis=1)
