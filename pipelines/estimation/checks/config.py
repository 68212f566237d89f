"""Set the numbers that decide what the logged torque is."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BoundaryConfig"]


@dataclass(frozen=True)
class BoundaryConfig:
    """The numbers of the torque boundary, each with its meaning and its source.

    Attributes:
        order_rows: moments with which orders of the columns are compared.
        orders: other orders that are fitted in full.
        few: joints that move, up to which every order is tried.
        model_error: of a torque's RMS, the resolution of good torque sensors: smaller residuals
            are no evidence for one model against another.
        decisive: gain in log likelihood that decides between two models, after the residual's
            correlation is counted: odds of 20,000.
        alike: difference in log likelihood, below which two answers are equally likely: odds 150.
        explained: share of the residual power of the rejected model that the accepted one may
            leave.
        lost: of the torques' RMS: where all joints together leave more, every order is tried, and
            not only exchanges of two columns.
        suspect: of a torque's RMS, three times the error of the model: where no joint leaves more,
            other orders are not tried.
        tilt: [rad] 15 degrees: more than levelling leaves, so that the description is wrong and not
            the mounting.
        absent: of the gravity torque: a smaller share is an error of the compensation.
        undetermined: standard deviation of a share, above which it is not identifiable.
        wide: of g: standard deviation of the gravity vector across itself, of the three before any
            data, above which its size is not identifiable.
        direction_std: [rad] 2.5 degrees: standard deviation of a direction, above which it is not
            identifiable: two of them are 5 degrees.
        friction_absent: of torque times speed, both RMS: less is what compensation leaves, or a
            direct drive; geared drives have 10 to 50 %.
        no_negative: times the noise of a channel: a torque below minus that is negative.
        touches: times that a signed torque does not come down to zero without crossing it once.
        near: of the RMS: a torque at zero.
        far: of the RMS: a torque that is away from zero again.
        below: of the samples at zero: a magnitude has none below it.
        standing: of its RMS: a joint that is slower may stand, held by its brake.
        held: of the travel of the joint that moves most: a joint that moves less is held.
        loose: [m/s^2] standard deviation of each component of gravity before any data: three times
            g, so that what no data tell stays finite.
        periods: of the motion's mean period: length of the filter, which then keeps 4 harmonics.
        widths: of a joint's RMS speed: where laws of friction bend.
        clusters: of all moments together.
        moved_on: of twice the variance: a motion has moved on.
        returned: of twice the variance: a motion is back.
    """

    order_rows: int = 600
    orders: int = 12
    few: int = 4
    model_error: float = 0.003
    decisive: float = 10.0
    alike: float = 5.0
    explained: float = 0.5
    lost: float = 0.2
    suspect: float = 0.01
    tilt: float = 0.26
    absent: float = 0.2
    undetermined: float = 0.25
    wide: float = 2.0
    direction_std: float = 0.0436
    friction_absent: float = 0.02
    no_negative: float = 3.0
    touches: int = 3
    near: float = 0.03
    far: float = 0.3
    below: float = 0.1
    standing: float = 0.05
    held: float = 0.02
    loose: float = 30.0
    periods: float = 0.25
    widths: tuple[float, ...] = (0.05, 0.15, 0.5)
    clusters: int = 20
    moved_on: float = 0.3
    returned: float = 0.02
