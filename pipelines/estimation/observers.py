"""Choose how motion is reconstructed, and tune the observers to the encoders of a log."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.chain import ORDERS, stationary
from pipelines.estimation.config import ReconstructionConfig
from pipelines.estimation.grids import Measured, lay_on
from pipelines.estimation.smoother import smooth
from pipelines.estimation.state_estimation import BLOCK, Observer, design
from pipelines.estimation.tuning import sigma_for_bandwidth, tune_jerk, tune_smoother
from pipelines.io.log import Array
from pipelines.io.option import option
from pipelines.quality.segments import Usable

METHODS = ("smoother", "observer", "central-differences", "zero-phase")
_CONFIG = ReconstructionConfig()


@dataclass(frozen=True)
class Reconstruction:
    """How motion is reconstructed. What is None is found from the data, joint by joint.

    The paper's chain has order 3: a jerk held over each sample. Of a smooth motion its acceleration
    comes out too large by (ωT)²/12, which over 100 simulated experiments biases a parameter by 0.5
    standard deviations at worst; a held snap, order 4, errs by the fourth power of ωT.
    """

    method: str = option("smoother", "smoother, observer, zero-phase or central-differences.")
    # of the chain of integrators
    order: int = option(4, "Integrators in the observer: 2, 3 (Kostić et al. 2004) or 4.")
    jerk_std: tuple[float, ...] | None = option(
        None, "Jerk σ [rad/s^order]: one, or one a joint. [as data say]"
    )
    # -3 dB of the observer's position
    bandwidth: tuple[float, ...] | None = option(
        None, "Bandwidth [Hz], instead of jerk: one, or one a joint."
    )

    def as_settings(self) -> dict[str, object]:
        """Return what a derived log must have been made with to be used."""
        return asdict(self)

    def check(self, joints: int) -> None:
        """C02: a method, an order, or numbers that no log of so many joints can be done with."""
        if self.method not in METHODS:
            remedy = f"one of {', '.join(METHODS)}"
            raise UsageError("C02", f"'{self.method}' is no method", "--method", remedy)
        if self.order not in ORDERS:
            words = f"an observer of order {self.order}"
            raise UsageError("C02", words, "--order", "choose order 2, 3 or 4")
        if self.jerk_std is not None and self.bandwidth is not None:
            words = "jerk and bandwidth say the same thing twice"
            raise UsageError("C02", words, "--bandwidth", "give one of them")
        for name, values in (("--jerk-std", self.jerk_std), ("--bandwidth", self.bandwidth)):
            if values is not None and len(values) not in (1, joints):
                words = f"{len(values)} values for {joints} joints"
                raise UsageError("C02", words, name, "give one, or one a joint")
            if values is not None and not all(0.0 < value < np.inf for value in values):
                words = "a value that is not positive"
                raise UsageError("C02", words, name, "give positive numbers")


def encoder_resolution(good: Usable) -> Array:
    """Δθ of each joint [rad] (joints,): described, or seen in the samples, the coarser one."""
    described = [joint.encoder_resolution or 0.0 for joint in good.log.robot.joints]
    pairs = zip(good.steps, described, strict=True)
    return np.array([max(seen or 0.0, known) or _CONFIG.finest for seen, known in pairs])


@dataclass(frozen=True, eq=False)
class Observers:
    """The observer of eq. (20), and the one whose jerk is best for a filter that sees both sides.

    They are the same where the jerk was given. A smooth motion is no random walk: between its
    samples the smoother may trust them with 20 to 50 times less jerk than the observer, which looks
    ahead. Where the smoother looks ahead as well, at an end or over a long gap, the observer's is
    right. Cross-validation weighs bias against noise in the position; an estimate made of many
    samples feels the bias far more. So the smoother goes over what it left once more
    (`twicing_growth`): over 200 simulated experiments the worst bias of a parameter falls from 0.17
    to 0.03 standard deviations.
    """

    causal: Observer
    smoothing: Observer

    @property
    def twice(self) -> bool:
        """Return whether the smoother goes over what it left: where its jerk is found."""
        return self.smoothing is not self.causal


def tuned_observers(seen: Measured, how: Reconstruction) -> Observers:
    """Return the observers of a log, tuned on the longest stretch of its clock.

    Raises:
        UsageError: C02, a jerk level or a bandwidth that settles later than the log ends, or
            filters nothing by far.
    """
    grid, step, resolution = seen.longest, seen.step, encoder_resolution(seen.good)
    laid, joints = lay_on(seen.y[grid.first : grid.last], grid), seen.y.shape[1]
    try:
        causal = tune_jerk(laid, step, resolution, how.order)
    except InputRejected:  # no stretch without a missing sample is long enough
        variance = resolution**2 / 12.0
        quick = min(_CONFIG.bridge_hz, 0.1 / step)
        sigma = sigma_for_bandwidth(quick, step, variance, how.order)
        bridged = smooth(laid, design(step, sigma, variance, how.order)).states[0]
        laid = np.where(np.isfinite(laid), laid, bridged)
        causal = tune_jerk(laid, step, resolution, how.order)
    variance, sigma = causal.noise_variance, causal.jerk_std
    _refuse_far(how, variance, seen, len(laid))
    if how.jerk_std is not None:
        sigma = np.broadcast_to(np.array(how.jerk_std), joints)
    elif how.bandwidth is not None:
        hertz = np.broadcast_to(np.array(how.bandwidth), joints)
        sigma = sigma_for_bandwidth(hertz, step, variance, how.order)
    observer = design(step, sigma, variance, how.order)
    if how.method == "observer" or how.jerk_std is not None or how.bandwidth is not None:
        return Observers(observer, observer)
    both = tune_smoother(laid, step, resolution, how.order)
    # noise with a pattern passes for motion in cross-validation: never more jerk than causal
    sigma = np.minimum(both.jerk_std, sigma)
    return Observers(observer, design(step, sigma, both.noise_variance, how.order))


def _refuse_far(how: Reconstruction, variance: Array, seen: Measured, samples: int) -> None:
    """C02: a jerk level or bandwidth that no log of so many samples can be reconstructed with."""
    hertz = how.bandwidth is not None
    given, name = (how.bandwidth, "--bandwidth") if hertz else (how.jerk_std, "--jerk-std")
    if given is None:
        return
    step, order = seen.step, how.order
    samples = min(max(samples, 2 * BLOCK), _CONFIG.latest)
    # lowest and highest Λ = σ T^n / √R that forgets its start within `samples`, and still filters
    index = np.geomspace(1e-16, _CONFIG.nothing, 401)
    rate = -np.log(np.abs(stationary(order, index).poles).max(axis=1))
    ends = index[rate * samples >= _CONFIG.forgotten][[0, -1]]
    bounds = np.multiply.outer(ends, np.sqrt(variance) / step**order)  # (2, joints)
    if hertz:
        bounds = np.array([design(step, x, variance, order).bandwidth_hz for x in bounds])
        bounds = np.minimum(bounds, _CONFIG.fastest / step)
    joints = seen.good.log.robot.joints
    for j, joint in enumerate(joints):
        value, (low, high) = given[j if len(given) > 1 else 0], bounds[:, j].tolist()
        unit = "Hz" if hertz else f"{'rad' if joint.revolute else 'm'}/s^{order}"
        inside = (1.0 - _CONFIG.rounding) * low <= value <= (1.0 + _CONFIG.rounding) * high
        if inside and not (hertz and value >= 0.5 / step):
            continue
        why = "is half the rate or more" if hertz else "filters nothing at all"
        if value < low:
            why = f"settles later than the {samples * step:.3g} s there are"
        remedy = f"choose between {low:.3g} and {high:.3g} {unit}, "
        remedy += "or leave it to be found from the data"
        words = f"{value:g} {unit} for joint {j + 1}: that {why}"
        raise UsageError("C02", words, name, remedy)
