"""Numbers that decide a diagnosis, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.estimation.estimate import Recipe

__all__ = ["LIMITS", "RESPONSES", "DiagnosisConfig"]


@dataclass(frozen=True)
class LimitsConfig:
    """Numbers of the detection limits; no verdict depends on them."""

    power: float = 1.65  # normal deviate of 95 %, one-sided (Cohen 1988)
    worst: float = 0.25  # share of the shapes of a cause that may be seen worse than its limit says
    visible: float = 0.02  # share of a column that the model does not imitate, below which: nothing
    main: float = 0.1  # of a column: a parameter that makes up less of it does not hide it


@dataclass(frozen=True)
class ResponsesConfig:
    """When a mode of the reference has changed."""

    deviations: float = 3.0  # standard deviations of a frequency or stiffness
    alike: float = 0.03  # share of it, by which temperature and posture move it between sessions


LIMITS = LimitsConfig()
RESPONSES = ResponsesConfig()


@dataclass(frozen=True)
class DiagnosisConfig:
    """All deciding numbers of the diagnosis; `benchmarks.sensitivity` varies each by ½ and 2."""

    cutoff_hz: float | None = None  # zero-phase low-pass of all rows; None: as `recipe`
    lowest_hz: float = 10.0  # of a low-pass that is found: blocks and whitening need rows enough
    keep: float = 2.6  # rows a period of the low-pass; more fill a band that it keeps back
    highest_hz: float = 25.0  # of a low-pass that is found: above it quantised positions dominate
    alpha: float = 0.01  # family-wise error of screening, all candidates; of tests of one number
    set_alpha: float = 0.05  # of the model confidence set (Hansen, Lunde & Nason 2011)
    block: float = 1.0  # [s] blocks of the predictive score, longer than the low-pass remembers
    blocks_together: int = 3  # length of the moving blocks of the bootstrap, in blocks
    friction_drift: float = 0.3  # relative std of friction between sessions
    # of a joint's torque, whitened as its noise, in which a healthy machine differs from any
    # model: every drive ripples by a thousandth
    healthy_share: float = 0.001
    relevance: float = 0.02  # share of a cause's effect to which no law is exact
    variance_prior: float = 2.0  # pseudo-observations by which a variance is shrunk to its family's
    refits: int = 4  # candidates that are refitted exactly in a round
    # of the best gain, without or with what standing numbers have taken of it, from which a
    # candidate is refitted
    promising: float = 0.3
    causes: int = 4  # most causes in one session, at least 1
    ripple_orders: int = 24  # [1/rev] of torque-proportional ripple in the standing dictionary
    form_widths: int = 7  # sigmoids that make the form of a friction law
    drift_order: int = 3  # of the polynomial of time by which friction without a name drifts
    noise_bins: int = 8  # of speed, in each of which the noise of a joint has its own level
    knots: int = 10  # of the splines without a name
    event_candidates: int = 600  # windows that a search for a contact compares
    # of the excess residual, that causes have to explain where the rest does not fit; of what a
    # cause gains, that is left beside a shape without a name that explains another thing
    share: float = 0.5
    deviations: float = 2.0  # by which a number may lie outside its range and be taken for possible
    # mean square residual of a joint over the baseline's, from which it is too large
    excess: float = 2.0
    # share of a joint's torque that repeats or wanders, and no cause explains: a fault
    misfit: float = 0.01

    def recipe(
        self, decimation: int | None = None, min_speed: tuple[float, ...] = (0.0,)
    ) -> Recipe:
        """Return how rows are made: within the band that the motion and ripple of a turn fill.

        In closed loop, motion above that band is the response of the drive to noise: it lags the
        torque on every arm, and looks like a delay or a lag (Ljung 1999, 13.4).
        """
        return Recipe(
            cutoff_hz=self.cutoff_hz,
            decimation=decimation,
            keep=self.keep,
            min_speed=min_speed,
            orders=self.ripple_orders,
            lowest_hz=self.lowest_hz,
            highest_hz=self.highest_hz,
        )
