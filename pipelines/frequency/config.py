"""Numbers that decide in frequency responses, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BandConfig", "GroupingConfig", "ModesConfig", "RationalConfig"]
__all__ += ["ReportConfig", "ResponseConfig", "SignConfig", "TurningConfig"]


@dataclass(frozen=True)
class TurningConfig:
    """Limits of constant speed and of a repeated excitation."""

    plateau: float = 0.02  # of the largest speed, within which a reference is constant: no ramps
    settle: float = 0.5  # [s] a position loop of 1 Hz is within 5 % after three time constants
    shortest: float = 1.0  # [s] of a stretch: four periods of the lowest mode, for a mean
    still: float = 1e-3  # [rad/s] a slower joint does not turn: a turn in two hours
    same: float = 1e-9  # of the largest v, two periods are equal: rounding of ten digits of text
    lost: float = 0.1  # of the samples; beyond, what is filled in weighs as much (-20 dB)
    line: float = 1e-3  # of the strongest line of v, -60 dB: above leakage and rounding
    alike: float = 0.9  # of the autocorrelation at no lag, from which a lag may be a period


@dataclass(frozen=True)
class BandConfig:
    """Limits of the excited band."""

    shortest: int = 4  # samples of a segment: two bins
    power: float = 1e-4  # of v's mean density weighted with itself: windows leak 40 dB down
    known: float = 10.0  # |G|² over its variance, 10 dB (Pintelon, Schoukens 2012, §2.4)
    # share of a frequency over whose median that is asked: an antiresonance is no end of the band
    around: float = 0.15
    # times the usual distance of neighbours, and share of a frequency: beyond, there is a hole
    hole: tuple[float, float] = (4.0, 0.1)
    fewest: int = 5  # frequencies of an interval
    exact: float = 1e-12  # of the square of the response: a variance below this is rounding


@dataclass(frozen=True)
class ResponseConfig:
    """Numbers of a response."""

    same_posture: float = 0.02  # [rad] within which two logs are of one posture
    highest: float = 0.45  # of the rate
    lowest: float = 0.5  # [Hz]
    segments: int = 8  # at least, for coherence and variance of Welch's method
    of_lines: int = 3  # the same of a periodic v, whose lines do not leak
    most: float = 0.7  # of the samples that lie in stretches as long as a segment, at least
    shorter: float = 0.9  # factor from one trial of a segment to the next
    no_power: float = 1e-9  # of the strongest bin of the source: 90 dB, above leakage and rounding
    folded: float = 0.1  # of the density of v in its band, near half the rate: it goes on beyond
    constant: tuple[float, float] = (10.0, 80.0)  # [Hz] where input and torque are compared
    density: float = 4.0  # [s] of the segments that show where v has power: Hann leaks two bins


@dataclass(frozen=True)
class RationalConfig:
    """The search for a rational function."""

    dampings: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1, 0.3)  # tried for a new pair of poles
    frequencies: int = 150  # tried for it
    refined: int = 3  # of the trials
    delays: int = 100  # tried, in eighths of a period of the highest frequency, early and late
    leap: float = 3.0  # of the logarithm of gain, b or a at once
    smallest: float = 1e-4  # of b and a of the poles: where a negative numerator starts
    rough: tuple[int, float] = (12, 1e-3)  # steps and relative decrease of a trial
    fine: tuple[int, float] = (60, 1e-7)  # the same of a refinement
    stiffest: float = 1e8  # damping of a step beyond which no shorter one helps
    patience: int = 2  # sections more that do not pay before the search ends
    most: int = 6  # sections of the denominator
    fewest: int = 18  # bins: too few for gain, delay and one mode
    exact: float = 1e-12  # of the square of the response: a variance below this is rounding
    floor: float = 1e-3  # relative deviation that every bin has, for what the model leaves out
    rank: float = 1e-14  # of normal equations, below which a direction is rounding
    cancels: float = 2.0  # standard deviations within which two modes take each other away


@dataclass(frozen=True)
class ModesConfig:
    """Numbers of the modes."""

    # [Hz] below it friction and gravity are at work, above it hardly any log has signal
    band: tuple[float, float] = (4.0, 250.0)
    of_rate: float = 0.3  # highest frequency of a mode, of the rate
    stiffest: float = 0.35  # damping ratio beyond which a pair is no mode
    sure: float = 0.05  # relative std of a frequency that is known at all
    # relative std of a damping beside noise: on the bench, swings of a tenth change it by 2-6 %
    by_friction: float = 0.03
    straight: tuple[float, float] = (8.0, 150.0)  # [Hz] over which level and delay are taken
    vague: float = 0.1  # relative variance of a bin that tells nothing of level and delay
    fewest: int = 12  # bins
    stuck: float = 3.0  # misfit that a search which found the modes hardly leaves
    seen_over: float = 0.15  # share of the frequency that the noise of a mode is averaged over


@dataclass(frozen=True)
class GroupingConfig:
    """Limits by which a mode is named."""

    tells: float = 9.0  # χ² by which one explanation must be better: three deviations
    fits: float = 4.0  # χ² per number beyond which nothing is explained: two deviations
    granted: float = 0.008  # of a frequency that masses and springs are granted: J is averaged
    exact: float = 1e-3  # relative deviation of a frequency at least
    rotor: float = 0.95  # of the least J, at most turns behind a gear
    impossible: float = 1e3  # deviations that bodies which cannot exist count as
    heavy: float = 2.0  # rise above which what drops out outweighs the rest: no base does so
    light: float = 0.5  # of the arm's inertia: no base weighs less, or the arm would carry it
    moves: float = 1.03  # ratio of inertias that tells base from joint: four of `granted`
    # a ratio of magnitudes below it is flat, 1.2 dB: half the step by a motor of a quarter of the
    # inertia. Sensitivity in benchmarks/README
    flat: float = 1.15
    span: float = 4.0  # highest over lowest frequency of a band without a mode: two octaves
    delay: float = 0.15  # of the sample time, the smallest worth a word; a hold makes half of one
    sure: float = 5.0  # standard deviations of a delay
    near: float = 0.03  # share of a frequency within which two joints show the same base
    misfit: float = 10.0  # over noise: F of many bins at 1e-6 is near 2, variances as much off
    left: float = 0.02  # of the response, what a misfit may leave: encoder steps that repeat
    # deviations of the torque by which its mean keeps the load on one side: beyond, one sample
    # in 44, and the describing function of a gap moves by no more
    closed: float = 2.0
    # damping ratio of teeth in contact at least, .03 to .17 (Kasuba, Evans 1981, ASME J. Mech.
    # Des. 103); shafts have .005 to .075 (Lin, Huston, Coy 1988, NASA TM-100180)
    contact: float = 0.03


@dataclass(frozen=True)
class SignConfig:
    """When a joint accelerates against its input."""

    slow: float = 20.0  # [Hz] up to which friction and delay turn the phase by less than 90°
    first: float = 2.0  # times the lowest excited frequency: between two modes it is turned round
    fewest: int = 3  # bins
    against: float = -0.5  # cosine of the phase: beyond 120°


@dataclass(frozen=True)
class ReportConfig:
    """Limits of what is reported, and warned of."""

    swing: float = 0.25  # of the turning speed: four deviations of it turn friction's sign
    coherence: float = 0.7  # Kostić et al. 2004, Section IV.D: less is not reliable
