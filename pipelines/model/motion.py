"""The motion of a log: position, speed and acceleration of every joint, by the method asked for.

    found = reconstruct(log, Reconstruction())
    found.motion.q, .dq, .ddq                  at the log's own samples; NaN where no usable stretch is

Kostić et al. 2004, Section IV.C.4, eq. (16)-(21). A log that holds the signals already, derived from the same recording
with the same settings, is taken at its word; anything else is computed.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.derive import derived_by
from pipelines.log.doctor.segments import Usable, usable
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.rigid.body import Motion
from pipelines.signal.gaps import Stretch, even_stretches, lay
from pipelines.signal.observer import Observer, design, observe
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import sigma_for_bandwidth, tune_jerk, tune_smoother

__all__ = ["METHODS", "Reconstructed", "Reconstruction", "encoder_resolution", "reconstruct"]

METHODS = ("smoother", "observer", "central-differences", "zero-phase")
# A joint that stands still has no jerk to tune by: the slowest level ever tried would do, any level reconstructs rest.
_FALLBACK_RESOLUTION = 1e-6  # [rad] where neither description nor samples show a step: far below any encoder


@dataclass(frozen=True)
class Reconstruction:
    """How motion is reconstructed. What is None is found from the data, joint by joint."""

    method: str = "smoother"
    order: int = 3  # of the chain of integrators: 3 is the paper's
    jerk_std: tuple[float, ...] | None = None  # σ [rad/s^order], one a joint or one for all
    bandwidth: tuple[float, ...] | None = None  # [Hz] -3 dB of the position, instead of jerk_std

    def as_settings(self) -> dict[str, object]:
        """What a derived log must have been made with to be used."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Reconstructed:
    """Motion with its uncertainty, and the observer it came from."""

    motion: Motion  # at every sample of the recording
    std: tuple[Array, Array, Array] | None  # of q, dq, ddq, each (samples, joints); None where the method has none
    observer: Observer | None  # as tuned on the longest stretch
    whiteness: Array | None  # (joints,) of its innovations, about standard normal where the observer fits
    good: Usable  # which samples, stretches and masks
    derived: bool  # taken from the log instead of computed


def encoder_resolution(good: Usable) -> Array:
    """Δθ of each joint [rad] (joints,): the description's, or the step the samples show, whichever is coarser."""
    from pipelines.log.doctor.faults import quantum

    shown = [quantum(column) or 0.0 for column in good.log.q.T]
    said = [joint.encoder_resolution or 0.0 for joint in good.log.robot.joints]
    return np.array([max(pair) or _FALLBACK_RESOLUTION for pair in zip(shown, said, strict=True)])


def reconstruct(log: ExperimentLog, how: Reconstruction) -> Reconstructed:
    """The motion of `log`.

    Raises:
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    good = usable(log)
    if not good.runs:
        raise InputRejected("T04", "no stretch without a gap is long enough to reconstruct motion from", where=log.source or log.name,
                            remedy="'rrrid inspect' shows what is missing; record again")
    if derived_by(log, "reconstruct", how.as_settings()):
        return _taken(log, good)
    y = np.where(good.missing | good.position_spikes, np.nan, good.log.q)
    states = np.full((3, *log.q.shape), np.nan)
    std = np.full((3, *log.q.shape), np.nan)
    observer, whiteness = tuned_observer(good, y, how) if how.method in ("smoother", "observer") else (None, None)
    for run in good.runs:
        for stretch in even_stretches(good.log.t[run], log.sample_time):
            rows = good.kept[run][stretch.first:stretch.last]
            found, sigma = _track(lay(y[run], stretch), stretch, how, observer, log.sample_time)
            states[:, rows] = found
            if sigma is not None:
                std[:, rows] = sigma
    motion = Motion(log.t, states[0], states[1], states[2])
    return Reconstructed(motion, None if observer is None else (std[0], std[1], std[2]), observer, whiteness, good, False)


def _taken(log: ExperimentLog, good: Usable) -> Reconstructed:
    motion = Motion(log.t, log["q_hat"], log["dq_hat"], log["ddq_hat"])
    known = "q_hat_std" in log
    return Reconstructed(motion, (log["q_hat_std"], log["dq_hat_std"], log["ddq_hat_std"]) if known else None, None, None, good, True)


def tuned_observer(good: Usable, y: Array, how: Reconstruction) -> tuple[Observer, Array]:
    """The observer of the longest run, with the whiteness of its innovations there."""
    run = max(good.runs, key=lambda r: r.stop - r.start)
    stretch = max(even_stretches(good.log.t[run], good.log.sample_time), key=lambda s: s.last - s.first)
    samples, step, n = lay(y[run], stretch), good.log.sample_time, good.log.n_joints
    resolution = encoder_resolution(good)
    tuned = (tune_smoother if how.method == "smoother" else tune_jerk)(samples, step, resolution, how.order)
    sigma = tuned.jerk_std
    if how.jerk_std is not None:
        sigma = np.broadcast_to(np.array(how.jerk_std), n)
    elif how.bandwidth is not None:
        sigma = sigma_for_bandwidth(np.broadcast_to(np.array(how.bandwidth), n), step, tuned.noise_variance, how.order)
    observer = design(step, sigma, tuned.noise_variance, how.order)
    from pipelines.signal.tuning import innovations, whiteness

    return observer, whiteness(innovations(samples, observer)).statistic


def _track(y: Array, stretch: Stretch, how: Reconstruction, observer: Observer | None, step: float) -> tuple[Array, Array | None]:
    """(3, samples, joints) of one stretch at its measured places, and the standard deviations."""
    if observer is not None:
        track = smooth(y, observer) if how.method == "smoother" else observe(y, observer)
        return track.states[:3, stretch.place], track.full_std()[:3, stretch.place]
    if how.method == "central-differences":
        return _central(y, step)[:, stretch.place], None
    return _zero_phase(y, step, how)[:, stretch.place], None


def _central(y: Array, step: float) -> Array:
    """(y_{k+1} - y_{k-1}) / 2T and (y_{k+1} - 2 y_k + y_{k-1}) / T²; the outermost samples are not known."""
    dq, ddq = np.full_like(y, np.nan), np.full_like(y, np.nan)
    dq[1:-1] = (y[2:] - y[:-2]) / (2.0 * step)
    ddq[1:-1] = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / step**2
    return np.stack([y, dq, ddq])


def _zero_phase(y: Array, step: float, how: Reconstruction) -> Array:
    """Butterworth of order 4 forward and backward, then central differences; 100 Hz where no bandwidth is asked for."""
    from pipelines.signal.filters import design_low_pass, zero_phase

    if np.isnan(y).any():
        raise InputRejected("T03", "a zero-phase filter needs every sample, and some are missing",
                            remedy="reconstruct with the smoother, which predicts through gaps")
    cutoff = 100.0 if how.bandwidth is None else max(how.bandwidth)
    return _central(zero_phase(y, design_low_pass(min(cutoff, 0.4 / step), 1.0 / step)), step)
