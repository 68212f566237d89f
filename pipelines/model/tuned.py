"""The observer that fits the encoders of a log: noise from their resolution or their samples, jerk as asked or as they show."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.io.log import Array
from pipelines.io.option import option
from pipelines.quality.segments import Usable
from pipelines.signal.chain import ORDERS, stationary
from pipelines.signal.grid import Grid, lay_on
from pipelines.signal.observer import BLOCK, Observer, design
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import sigma_for_bandwidth, tune_jerk, tune_smoother

__all__ = ["METHODS", "Observers", "Reconstruction", "encoder_resolution", "tuned_observers"]

METHODS = ("smoother", "observer", "central-differences", "zero-phase")
_FALLBACK_RESOLUTION = 1e-6  # [rad] where neither description nor samples show a step: far below any encoder
_FORGOTTEN = 7.0  # time constants after which a start is forgotten to about 1/1000
_LATEST = 32768  # samples by which an observer must have forgotten its start, however long the log
_NOTHING = 1e4  # tracking index from which nothing is filtered by far, the largest that tuning tries
_FASTEST = 0.49  # of the rate, the bandwidth that is named as the highest; below half of it any is taken
_ROUNDING = 0.1  # of a bound: what is printed of it is accepted
_BRIDGE_HZ = 100.0  # of the observer that bridges missing samples before anything is tuned


@dataclass(frozen=True)
class Reconstruction:
    """How motion is reconstructed. What is None is found from the data, joint by joint.

    The paper's chain has order 3: a jerk held over each sample. Beside a smooth motion its acceleration comes out too large
    by (ωT)²/12, 1 part in 150,000 at 1.4 Hz and 1 kHz, which is a third of the standard deviation of an inertia from 10 s; a
    held snap, order 4, errs by the fourth power of ωT. Over 100 simulated experiments the worst bias that reconstruction adds
    to a parameter is 0.5 standard deviations with order 3 and 0.03 with order 4 (`Observers`).
    """

    method: str = option("smoother", "smoother, observer, zero-phase or central-differences.")
    # of the chain of integrators
    order: int = option(4, "Integrators in the observer: 2, 3 (Kostić et al. 2004) or 4.")
    jerk_std: tuple[float, ...] | None = option(
        None, "Jerk σ [rad/s^order]: one, or one a joint. [as data say]")
    # -3 dB of the observer's position
    bandwidth: tuple[float, ...] | None = option(
        None, "Bandwidth [Hz], instead of jerk: one, or one a joint.")
    average: bool = option(
        True, "Of a periodic log, take the mean of periods that differ by noise alone. [average]", "--average/--no-average")

    def as_settings(self) -> dict[str, object]:
        """What a derived log must have been made with to be used; the motion of its samples is the same, averaged or not."""
        return {name: value for name, value in asdict(self).items() if name != "average"}

    def check(self, joints: int) -> None:
        """C02: one of the methods and orders there are, and one positive number a joint or one for all."""
        if self.method not in METHODS:
            raise UsageError("C02", f"'{self.method}' is no method", where="--method", remedy=f"one of {', '.join(METHODS)}")
        if self.order not in ORDERS:
            raise UsageError("C02", f"an observer of order {self.order}", where="--order", remedy="choose order 2, 3 or 4")
        if self.jerk_std is not None and self.bandwidth is not None:
            raise UsageError("C02", "jerk and bandwidth say the same thing twice", where="--bandwidth", remedy="give one of them")
        for name, values in (("--jerk-std", self.jerk_std), ("--bandwidth", self.bandwidth)):
            if values is not None and len(values) not in (1, joints):
                raise UsageError("C02", f"{len(values)} values for {joints} joints", where=name, remedy="give one, or one a joint")
            if values is not None and not all(0.0 < value < np.inf for value in values):
                raise UsageError("C02", "a value that is not positive", where=name, remedy="give positive numbers")


def encoder_resolution(good: Usable) -> Array:
    """Δθ of each joint [rad] (joints,): the description's, or the step the samples show, whichever is coarser."""
    said = [joint.encoder_resolution or 0.0 for joint in good.log.robot.joints]
    return np.array([max(shown or 0.0, told) or _FALLBACK_RESOLUTION for shown, told in zip(good.steps, said, strict=True)])


@dataclass(frozen=True)
class Observers:
    """The observer of eq. (20), and the one whose jerk is best for a filter that sees both sides; the same where it was asked for.

    A smooth motion is no random walk: between its samples the smoother may trust them with 20 to 50 times less jerk than
    the observer, which looks ahead. Where the smoother looks ahead as well, at an end or over a long gap, the observer's is right.

    Cross-validation weighs bias against noise in the position. An estimate made of many samples feels the bias far more: it
    does not average out. So the smoother goes over what it left once more (`twicing_growth`), which squares what is left of
    the motion and costs a third more noise in the acceleration; three times the jerk would have doubled it. Measured over
    2 x 100 simulated experiments, as the worst bias that reconstruction adds to a parameter, and the error held out:

        |                           | bias, seeds 0-99 | seeds 500-599 | sample logs | TX40      |
        | one pass                  | 0.17 std         | 0.15 std      | 0.5849 %    | 13.6762 % |
        | two passes                | 0.03             | 0.02          | 0.5850 %    | 13.6760 % |
        | one, twice the jerk       | 0.07             | 0.05          | 0.5866 %    | 13.6762 % |
        | one, three times          | 0.05             | 0.03          | 0.5878 %    | 13.6762 % |
        | one, half way to causal's | 0.05             | 0.03          | 0.5979 %    | 13.6762 % |
    """

    causal: Observer
    smoothing: Observer

    @property
    def twice(self) -> bool:
        """Return whether the smoother goes over what it left: where its jerk is found, not asked for."""
        return self.smoothing is not self.causal


def tuned_observers(good: Usable, y: Array, grid: Grid, step: float, how: Reconstruction) -> Observers:
    """The observers for `y` (samples, joints), tuned on the rows of `grid`.

    Raises:
        UsageError: C02, a jerk level or a bandwidth that settles later than the log ends, or filters nothing by far.
    """
    rows, resolution = y[grid.first:grid.last], encoder_resolution(good)
    units = tuple("rad" if joint.revolute else "m" for joint in good.log.robot.joints)
    return _tuned(lay_on(rows, grid), step, resolution, how, units)


def _tuned(laid: Array, step: float, resolution: Array, how: Reconstruction, units: tuple[str, ...]) -> Observers:
    try:
        causal = tune_jerk(laid, step, resolution, how.order)
    except InputRejected:  # no stretch without a missing sample is long enough
        laid = _bridged(laid, step, resolution, how.order)
        causal = tune_jerk(laid, step, resolution, how.order)
    sigma, joints = causal.jerk_std, laid.shape[1]
    _refuse_far(how, causal.noise_variance, step, len(laid), units)
    if how.jerk_std is not None:
        sigma = np.broadcast_to(np.array(how.jerk_std), joints)
    elif how.bandwidth is not None:
        sigma = sigma_for_bandwidth(np.broadcast_to(np.array(how.bandwidth), joints), step, causal.noise_variance, how.order)
    observer = design(step, sigma, causal.noise_variance, how.order)
    if how.method == "observer" or how.jerk_std is not None or how.bandwidth is not None:
        return Observers(observer, observer)
    both = tune_smoother(laid, step, resolution, how.order)
    # noise with a pattern passes for motion in cross-validation: never more jerk than looking ahead asks for
    return Observers(observer, design(step, np.minimum(both.jerk_std, sigma), both.noise_variance, how.order))


def _refuse_far(how: Reconstruction, variance: Array, step: float, samples: int, units: tuple[str, ...]) -> None:
    """C02 for a jerk level or bandwidth that no log of so many samples can be reconstructed with, and which ones can."""
    asked, name = (how.jerk_std, "--jerk-std") if how.jerk_std is not None else (how.bandwidth, "--bandwidth")
    if asked is None:
        return
    samples = min(max(samples, 2 * BLOCK), _LATEST)
    bounds = np.multiply.outer(_tracking_bounds(how.order, samples), np.sqrt(variance) / step**how.order)  # (2, joints)
    if how.bandwidth is not None:
        bounds = np.minimum([design(step, sigma, variance, how.order).bandwidth_hz for sigma in bounds], _FASTEST / step)
    for j, (value, low, high) in enumerate(zip(np.broadcast_to(np.array(asked), len(units)), *bounds, strict=True)):
        unit, top = ("Hz", 0.5 / step) if how.bandwidth is not None else (f"{units[j]}/s^{how.order}", np.inf)
        if not (1.0 - _ROUNDING) * low <= value <= (1.0 + _ROUNDING) * high or value >= top:
            why = (f"settles later than the {samples * step:.3g} s there are" if value < low else
                   "is half the rate or more" if how.bandwidth is not None else "filters nothing at all")
            raise UsageError("C02", f"{value:g} {unit} for joint {j + 1}: that {why}", where=name,
                             remedy=f"choose between {low:.3g} and {high:.3g} {unit}, or leave it to be found from the data")


def _tracking_bounds(order: int, samples: int) -> Array:
    """Lowest and highest Λ = σ T^n / √R whose observer forgets its start within `samples`, and still filters."""
    index = np.geomspace(1e-16, _NOTHING, 401)
    radius = np.abs(stationary(order, index).poles).max(axis=1)
    return np.asarray(index[-np.log(radius) * samples >= _FORGOTTEN][[0, -1]])


def _bridged(laid: Array, step: float, resolution: Array, order: int) -> Array:
    """Missing samples as a quick smoother predicts them: for the tuning alone."""
    variance = resolution**2 / 12.0
    quick = design(step, sigma_for_bandwidth(min(_BRIDGE_HZ, 0.1 / step), step, variance, order), variance, order)
    return np.where(np.isfinite(laid), laid, smooth(laid, quick).states[0])
