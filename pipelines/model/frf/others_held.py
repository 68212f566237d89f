"""Take the motion of the other joints out of a response: what the joint would answer were they held.

    τ_j = Z_jj(s) a_j + F(s) Σ_k D_jk a_k,    Z_jj(s) = D_jj + Σ_m (c_m + d_m s) / (1 + b_m s + a_m s²) + friction, gravity

a_k are accelerations and D is the mass matrix. What gives way makes the poles of the dynamic stiffness Z (Ewins 2000, Modal
Testing, §2.4): a base those of Z_jj alone (F = 1), a spring in the joint those of all that its link carries (F = 1 over its
section). The other joints are held by their controllers, and above the band of those they swing freely: the inertia at joint j
then falls from D_jj towards 1 / (D⁻¹)_jj, which looks like a heavily damped mode. Their motion is in the log; with it D_jk is
found by least squares over frequency, linear once the poles are given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.frf.controller import Complex
from pipelines.signal.frequency_response import FrequencyResponse, Responses, closed_loop

__all__ = ["HeldConfig", "others_held"]


@dataclass(frozen=True)
class HeldConfig:
    """How Z is found.

    Attributes:
        poles: pairs of them at most: a base and a joint.
        frequencies, dampings: tried for each pair, the best of which is refined up to the largest damping.
        gain: of the squares that are left, the share that a further pair of poles may leave at most. Errors of the model are
            alike over many bins: statistics of independent bins would let it follow them. True modes leave a tenth.
        floor: of the torque, what the model leaves out in every bin.
        fewest: bins.
    """

    poles: int = 2
    frequencies: int = 60
    dampings: tuple[float, ...] = (0.01, 0.02, 0.05, 0.1, 0.2)
    gain: float = 1.0 / 3.0
    floor: float = 0.01
    fewest: int = 20


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares with some poles."""

    sections: tuple[Complex, ...]  # 1 + b s + a s² (bins,) of each pair of poles
    coupling: Complex  # F D_jk (bins, other joints)
    cost: float  # weighted sum of squares


@dataclass(frozen=True, eq=False)
class _Rows:
    """What is fitted at every frequency."""

    torque: Complex  # (bins,)
    acceleration: Complex  # a_j, then those of the others (bins, joints)
    weight: Array  # 1 / std of a part of the rest (bins,)
    s: Complex  # jω (bins,)


def others_held(responses: Responses, rigid: Complex, torque: int, position: int, others: tuple[int, ...],
                config: HeldConfig | None = None) -> FrequencyResponse | None:
    """The response from torque to position with the other joints held; None where their motion does not matter.

    Args:
        responses: from v to torque and all positions, in the excited band.
        rigid: position over acceleration (bins,), complex: the double integrator as it was sampled.
        torque, position, others: places among the outputs.
    """
    config = config or HeldConfig()
    if not others or len(responses.frequency) < config.fewest:
        return None
    s = np.asarray(2j * np.pi * responses.frequency)
    target = responses.response[:, torque]
    own = responses.covariance[:, torque, torque].real + (config.floor * np.abs(target)) ** 2
    rows = _Rows(target, responses.response[:, [position, *others]] / rigid[:, None], 1.0 / np.sqrt(0.5 * own), s)
    first = _least_squares(rows, (), None)
    to = _taking(responses, first.coupling, rigid, torque, position, others)
    left = np.einsum("ba,bac,bc->b", to[:, 0], responses.covariance, np.conj(to[:, 0])).real + (config.floor * np.abs(target)) ** 2
    rows = replace(rows, weight=1.0 / np.sqrt(0.5 * left))
    coupled = _with_poles(rows, config)
    to = _taking(responses, coupled.coupling, rigid, torque, position, others)
    return closed_loop(replace(responses, response=(to @ responses.response[:, :, None])[..., 0],
                               covariance=to @ responses.covariance @ np.conj(np.swapaxes(to, 1, 2)),
                               coherence=responses.coherence[:, [torque, position]]))


def _taking(responses: Responses, coupling: Complex, rigid: Complex, torque: int, position: int,
            others: tuple[int, ...]) -> Complex:
    """From all outputs to the torque less that of the other joints, and the position (bins, 2, outputs)."""
    to = np.zeros((len(rigid), 2, responses.response.shape[1]), dtype=np.complex128)
    to[:, 0, torque], to[:, 1, position] = 1.0, 1.0
    to[:, 0, list(others)] = -coupling / rigid[:, None]
    return to


def _with_poles(rows: _Rows, config: HeldConfig) -> _Fit:
    """A pair of poles more as long as that explains most of what is left."""
    best = _least_squares(rows, (), None)
    for number in range(config.poles):
        more = min((_pole_more(rows, best, by, config) for by in (None, *range(number + 1))), key=lambda fit: fit.cost)
        if more.cost > config.gain * best.cost:
            break
        best = more
    return best


def _pole_more(rows: _Rows, known: _Fit, filtered: int | None, config: HeldConfig) -> _Fit:
    """The best pair of poles more: over the whole band, then nearer and nearer to the best."""
    omega = np.abs(rows.s)
    frequencies, dampings = np.geomspace(omega[0], omega[-1], config.frequencies), np.array(config.dampings)
    step, best = np.log(frequencies[1] / frequencies[0]), known
    for narrower in (0.5, 0.25, 0.125, 0.0625, 0.0312, 0.0156):
        tried = [(_least_squares(rows, (*known.sections, 1.0 + 2.0 * z * rows.s / w + (rows.s / w) ** 2), filtered), w, z)
                 for w in frequencies for z in dampings]
        best, w, z = min(tried, key=lambda one: one[0].cost)
        frequencies = w * np.exp(narrower * step * np.array([-1.0, 0.0, 1.0]))
        dampings = np.minimum(z * 2.0 ** (narrower * np.array([-1.0, 0.0, 1.0])), config.dampings[-1])
    return best


def _least_squares(rows: _Rows, sections: tuple[Complex, ...], filtered: int | None) -> _Fit:
    """Real coefficients of every column, F = 1 over the section `filtered`."""
    s, own = rows.s, rows.acceleration[:, :1]
    through = 1.0 if filtered is None else 1.0 / sections[filtered][:, None]
    shapes = np.stack([np.ones_like(s), 1.0 / s, 1.0 / s**2, *(part for one in sections for part in (1.0 / one, s / one))], axis=1)
    columns = np.concatenate([own * shapes, rows.acceleration[:, 1:] * through], axis=1) * rows.weight[:, None]
    stacked = np.concatenate([columns.real, columns.imag])
    right = np.concatenate([(rows.torque * rows.weight).real, (rows.torque * rows.weight).imag])
    size = np.maximum(np.sqrt((stacked**2).sum(axis=0)), 1e-300)
    stacked /= size
    solution = np.linalg.pinv(stacked.T @ stacked, rcond=1e-10, hermitian=True) @ (stacked.T @ right)
    cost = max(float(((right - stacked @ solution) ** 2).sum()), 1e-300)
    coupling = np.broadcast_to((solution / size)[shapes.shape[1]:] * through, (len(s), rows.acceleration.shape[1] - 1))
    return _Fit(sections, np.asarray(coupling, dtype=np.complex128), cost)
