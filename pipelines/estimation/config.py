"""Numbers that decide in estimation, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TuningConfig:
    """How observer and smoother are tuned to samples."""

    window: int = 32768  # samples a channel is tuned on: the liveliest stretch of this length
    still: int = 64  # samples: as long with values within 2.5 encoder steps is standing still
    noisier: float = 2.0  # times Δθ²/12: noise above this is taken instead of the resolution
    noise_cap: float = 1e8  # times Δθ²/12: no more than this is ever taken


@dataclass(frozen=True)
class GridConfig:
    """When a clock has one grid, and how much of it may be missing."""

    long: int = 4096  # missing samples: of more, only the first are predicted
    predicted: int = 1024  # samples: those
    bridged: int = 10  # missing samples: after more a new grid begins
    late: float = 1e-3  # of a sample: nearer than this, a sample lies on its place
    crowded: float = 0.05  # of all samples: more on a place with another is no clock


@dataclass(frozen=True)
class ClockConfig:
    """When a clock is uneven, and how its instants are estimated."""

    even: float = 1e-3  # of a sample time, rms of the intervals: 1e-6 rad at 1 rad/s and 1 kHz
    merged: float = 0.05  # of the samples that lie closer than a quarter step: no clock
    smooth_hz: float = 40.0  # above the motion of an arm: what a local polynomial leaves is noise
    order: int = 4  # of the local polynomial (Savitzky & Golay 1964)
    lag: int = 64  # steps of the variogram: long against one sample, short against a log
    sure: float = 3.0  # standard deviations, beyond which a walk is not due to chance
    around: int = 16  # samples before and after a long interval that tell whether one is lost
    passes: int = 3  # of the weights: they are known to a per cent then
    closest: float = 0.25  # of a step: nearer samples are replaced by their mean


@dataclass(frozen=True)
class PeriodConfig:
    """When periods are alike, and when the first has settled."""

    on_sample: float = 1e-3  # of a sample: nearer than this, a phase lies on a sample
    outlier: float = 3.0  # times the usual deviation of a period from the middle one
    windows: int = 100  # of a period, in which its start is compared with the rest
    shortest: int = 8  # samples of a window
    lull: int = 3  # windows in a row like the rest: what swings passes zero within one of them
    quiet: tuple[float, float] = (0.6, 0.9)  # of a period: like the later ones, if anything is
    unsettled: float = 2.0  # times the largest of the rest, and of the other periods there
    ended: float = 3.0  # times the power of the rest: less, and a start is over before that
    near: int = 10  # windows to either side that show how large the noise is at a phase
    falls: float = 6.0  # times less power at the end of a start: noise of one level does not


@dataclass(frozen=True)
class MeanPeriodConfig:
    """When the periods of a log may be averaged."""

    margin: float = 2.0  # [s] of copies on either side, at least: one period or several
    sparse: float = 2.0  # times the samples: a clock with more empty places is not folded
    alike_motion: float = 0.01  # of the motion: the curvature of the regressor leaves 1e-4 of it
    still: float = 1e-3  # [rad or m] that matters to no regressor
    alike_torque: float = 0.1  # of the torque
    noise: float = 3.0  # times what sample-to-sample noise explains: less is no difference
    drift: float = 0.25  # of the scatter that goes one way from the first period to the last
    sure: float = 5.0  # standard deviations of that share
    latest: float = 0.5  # of the first of two periods that it may take to settle


@dataclass(frozen=True)
class ReconstructionConfig:
    """Limits of reconstructed motion, and of what may be asked for."""

    finest: float = 1e-6  # [rad] where no step is described or seen: far below any encoder
    forgotten: float = 7.0  # time constants after which a start is forgotten to about 1/1000
    latest: int = 32768  # samples by which an observer must have forgotten its start
    nothing: float = 1e4  # tracking index from which nothing is filtered by far
    fastest: float = 0.49  # of the rate, the highest bandwidth that is named
    rounding: float = 0.1  # of a bound: what is printed of it is accepted
    bridge_hz: float = 100.0  # of the observer that bridges missing samples before tuning
    lead: int = 2  # missing samples at the very start that are predicted from what comes after
    cutoff_hz: float = 100.0  # of the zero-phase filter where no bandwidth is given
    highest: float = 0.4  # of the rate, its cut-off
    vague: float = 2.0  # times the usual standard deviation of the acceleration
    beyond: float = 5.0  # usual deviations: no bound below it, however still a joint stands


@dataclass(frozen=True)
class DriftConfig:
    """When a figure of one session has moved against those of the others."""

    limit: float = 3.0  # [std] beyond which a value has moved; by chance 1 of 370 is
    enough: int = 5  # items, to judge a residual by its scatter
    false_alarms: float = 0.01  # share of robots without drift that are reported with one


@dataclass(frozen=True)
class ResultConfig:
    """When reconstructed motion agrees with the measured one, and what figures show."""

    alarm: float = 5e-4  # [rad] of the position: Kostić et al. 2004, Fig. 10(a), stays below it
    slight: float = 0.2  # rms autocorrelation that changes a variance by less than a tenth
    white: float = 3.0  # standard deviations
    buckets: int = 400  # of an envelope
    longest: int = 131072  # samples that a spectrum or a test of whiteness looks at
