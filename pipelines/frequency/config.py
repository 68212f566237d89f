"""Numbers that decide in frequency responses, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BandConfig", "GroupingConfig", "HeldConfig", "LinesConfig", "ModesConfig"]
__all__ += ["PolynomialConfig", "RationalConfig", "ResponseConfig", "SignConfig", "SpringsConfig"]
__all__ += ["ReportConfig", "TurningConfig"]


@dataclass(frozen=True)
class TurningConfig:
    """Limits of constant speed and of a repeated excitation."""

    plateau: float = 0.02  # of the largest speed, within which a reference is constant: no ramps
    wandering: float = 0.2  # the same of a reconstructed speed, which the excitation swings
    smooth: float = 0.5  # [s] over which it is reconstructed: two periods of the lowest mode
    settle: float = 0.5  # [s] a position loop of 1 Hz is within 5 % after three time constants
    shortest: float = 1.0  # [s] of a stretch: four periods of the lowest mode, for a mean
    still: float = 1e-3  # [rad/s] a slower joint does not turn: a turn in two hours
    same: float = 1e-9  # of the largest v, two periods are equal: rounding of ten digits of text
    lost: float = 0.1  # of the samples; beyond, what is filled in weighs as much (-20 dB)
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


@dataclass(frozen=True)
class PolynomialConfig:
    """Windows of local polynomials."""

    order: int = 2  # of response and transient (Pintelon, Schoukens 2012, §7.2.2)
    freedom: int = 10  # least degrees of freedom of the noise: its own deviation is then a third
    half: int = 2  # bins to each side of a window at least: with fewer its transient takes all
    at_once: int = 500  # windows solved together: memory
    wider: float = 1.15  # factor from one trial of the width to the next
    empty: float = 1e-10  # of the strongest amplitude: what is smaller is rounding, no source
    leaked: float = 1e-6  # of the power in the strongest window: less leaked from lines elsewhere


@dataclass(frozen=True)
class LinesConfig:
    """Lines of a periodic excitation."""

    excited: float = 1e-3  # of the strongest amplitude: -60 dB, above leakage and rounding
    freedom: int = 10  # degrees of freedom of the noise at a line
    order: int = 2  # of the polynomial that the transient follows round a line
    shortest: int = 4  # samples of a period: one harmonic


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
    cancels: float = 2.0  # standard deviations within which two modes take each other away


@dataclass(frozen=True)
class ResponseConfig:
    """Numbers of a response."""

    same_posture: float = 0.02  # [rad] within which two logs are of one posture
    highest: float = 0.45  # of the rate
    lowest: float = 0.5  # [Hz]
    resolution: float = 0.25  # [Hz] where none is asked for and v does not repeat
    finest: float = 0.01  # [Hz] resolution that may be asked for
    coarsest: float = 20.0  # [Hz]
    segments: int = 4  # at least, for coherence and variance of Welch's method
    least: int = 64  # samples of a segment, below which it is not halved again
    no_power: float = 1e-12  # of the strongest bin of the source
    folded: float = 0.1  # of the density of v in its band, near half the rate: it goes on beyond
    coupled: float = 4.0  # [Hz] from where other joints' inertia outweighs friction and gravity
    octave: float = 2.5  # highest over lowest frequency that a rough inertia is taken from
    constant: tuple[float, float] = (10.0, 80.0)  # [Hz] where input and torque are compared
    postures: float = 3.0  # times that an inertia grows between postures: bounds coupled modes
    density: float = 4.0  # [s] of the segments that show where v has power: Hann leaks two bins
    smooth: int = 25  # lines over which distortion is compared with noise
    white: tuple[float, ...] = (0.35, 0.4, 0.45, 0.5)  # of the rate: bands of equal white noise
    level: float = 1.5  # of the densest of these bands over the least dense, at most


@dataclass(frozen=True)
class HeldConfig:
    """How the coupling with other joints is found."""

    modes: int = 3  # at most: a base and a spring in two joints
    dampings: tuple[float, ...] = (0.01, 0.02, 0.05, 0.1, 0.2)  # tried; the last is the largest
    lightest: float = 1e-3  # damping at least
    delay: float = 0.02  # [s] the largest
    floor: float = 0.01  # of the torque, what the model leaves out
    alike: float = 0.15  # share of the frequency over which that is the same: its bins are one
    weighings: int = 4  # times that the variance of the rest is renewed
    evaluations: int = 10  # of each refinement
    rank: float = 1e-12  # of normal equations, below which a direction is rounding
    attenuated: float = 0.5  # share of noise in normal equations beyond which it stays in them
    draws: int = 24  # of the response within what is known of the coupling
    fewest: int = 20  # bins
    # mean square of the motion of a joint over its noise's: of noise, D_jk would be any number
    moves: float = 2.0


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
    seen: float = 3.0  # standard deviations of its damping that a trace is more than nothing
    longest: float = 0.05  # [s] no delay is longer
    friction: float = 0.1  # of the magnitude, what friction has to change to be said
    held_still: float = 0.008  # of a frequency that masses and springs are granted: J is averaged
    seen_over: float = 0.15  # share of the frequency over which noise of reading is averaged
    parts: int = 4  # of a turn, whose scatter says something
    hann: float = 0.75  # variance of a part over that of a period: 3/2 of that of two periods


@dataclass(frozen=True)
class SpringsConfig:
    """The fit of masses and springs."""

    known: float = 1e-9  # the same of an inertia that is exactly known
    singular: float = 1e-12  # of J: a lighter body is lost in the sums of the mass matrix
    rotor: float = 0.95  # of the least J, at most turns behind a gear
    impossible: float = 1e3  # deviations that bodies which cannot exist count as


@dataclass(frozen=True)
class GroupingConfig:
    """Limits by which a mode is named."""

    tells: float = 9.0  # χ² by which one explanation must be better: three deviations
    fits: float = 4.0  # χ² per number beyond which nothing is explained: two deviations
    heavy: float = 2.0  # rise above which what drops out outweighs the rest: no base does so
    light: float = 0.5  # of the arm's inertia: no base weighs less, or the arm would carry it
    moves: float = 1.03  # ratio of inertias that tells base from joint: four of `held_still`
    # a ratio of magnitudes below it is flat, 1.2 dB: half the step by a motor of a quarter of the
    # inertia. Sensitivity in benchmarks/README
    flat: float = 1.15
    span: float = 4.0  # highest over lowest frequency of a band without a mode: two octaves
    delay: float = 0.15  # of the sample time, the smallest worth a word; a hold makes half of one
    sure: float = 5.0  # standard deviations of a delay
    near: float = 0.03  # share of a frequency within which two joints show the same base
    misfit: float = 10.0  # over noise: F of many bins at 1e-6 is near 2, variances as much off
    left: float = 0.02  # of the response, what a misfit may leave: encoder steps that repeat
    trace: float = 1.3  # rise of a pair that may be a trace of another joint, or of the base
    locked: float = 0.1  # share of the frequency at which a link swings against its locked motor
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
    known_at: tuple[float, ...] = (5.0, 28.0, 80.0)  # [Hz] error of a continuous controller
