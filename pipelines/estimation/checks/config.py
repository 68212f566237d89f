"""Set the numbers that decide what the logged torque is."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BoundaryConfig"]


@dataclass(frozen=True)
class BoundaryConfig:
    """When gravity, friction, sign or order of a torque are decided."""

    # order of the columns
    order_rows: int = 600  # moments with which orders are compared
    orders: int = 12  # other orders that are fitted in full
    few: int = 4  # joints that move, up to which every order is tried
    # of the torques' RMS: where all joints together leave more, every order is tried, and not only
    # exchanges of two columns
    lost: float = 0.2
    suspect: float = 0.01  # three times the error of the model: less is no reason to try others
    held: float = 0.02  # of the travel of the joint that moves most: less is held
    # models
    # of a torque's RMS, the resolution of good torque sensors: smaller residuals are no evidence
    # for one model against another
    model_error: float = 0.003
    decisive: float = 10.0  # gain in log likelihood that decides: odds of 20,000
    alike: float = 5.0  # difference below which two answers are equally likely: odds 150
    explained: float = 0.5  # of the residual power of the rejected model, that may be left
    # gravity
    tilt: float = 0.26  # [rad] 15 degrees: more than levelling leaves
    absent: float = 0.2  # of the gravity torque: a smaller share is an error of the compensation
    undetermined: float = 0.25  # std of a share, above which it is not identifiable
    wide: float = 2.0  # of g: std across itself, above which its size is not identifiable
    direction_std: float = 0.0436  # [rad] 2.5 degrees: two of them are 5 degrees
    # [m/s^2] std of each component before any data: three times g, so that what no data determine
    # stays finite
    loose: float = 30.0
    # of torque times speed, both RMS: less is what compensation leaves, or a direct drive; geared
    # drives have 10 to 50 %
    friction_absent: float = 0.02
    widths: tuple[float, ...] = (0.05, 0.15, 0.5)  # of the RMS speed, where laws of friction bend
    # sign
    no_negative: float = 3.0  # times the noise of a channel: a torque below minus that is negative
    touches: int = 3  # times that a signed torque comes down to zero without crossing it
    near: float = 0.03  # of the RMS: a torque at zero
    far: float = 0.3  # of the RMS: a torque that is away from zero again
    below: float = 0.1  # of the samples at zero: a magnitude has none below it
    standing: float = 0.05  # of its RMS speed: a joint that is slower may stand, held by its brake
    # rows
    periods: float = 0.25  # of the motion's mean period: the filter, which keeps 4 harmonics
    clusters: int = 20  # of all moments together
    moved_on: float = 0.3  # of twice the variance: a motion has moved on
    returned: float = 0.02  # of twice the variance: a motion is back
