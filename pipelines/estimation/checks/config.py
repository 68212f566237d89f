"""Set the numbers that decide what the logged torque is."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BoundaryConfig"]


@dataclass(frozen=True)
class BoundaryConfig:
    """The numbers of the torque boundary, each with its meaning and its source."""

    rows: int = 1500  # moments of all logs together; a regressor of seven joints then takes a tenth of a second
    order_rows: int = 600  # moments with which other orders of up to four joints are compared
    order_rows_many: int = 120  # of more joints, which have hundreds of orders: seven torques a moment then tell enough
    orders: int = 12  # other orders that are fitted in full
    # No rigid-body model predicts a torque better than this share of its RMS: the best published fits of recorded arms leave
    # 1.4 % (Gaz et al. 2019). A smaller residual is no evidence for one model against another.
    model_error: float = 0.01
    # Gain in log likelihood that decides between two models, after the residual's correlation is counted: odds of 20,000.
    decisive: float = 10.0
    explained: float = 0.5  # of the residual power under the described gravity is the most that another direction may leave
    lost: float = 0.2  # of the torques' RMS: where all joints together leave more, every order is tried, and not only exchanges
    suspect: float = 0.08  # of a torque's RMS: where no joint leaves more, other orders of the columns are not tried
    tilt: float = 0.26  # [rad] 15 degrees: more than levelling leaves, so that the description is wrong, and not the mounting
    absent: float = 0.2  # of the gravity torque: a share below is none, what is left is an error of the compensation
    undetermined: float = 0.25  # standard deviation of a share, above which its value is not told
    wide: float = 2.0  # of g: standard deviation across the vector, of the three before any data, above which its size is not told
    direction_std: float = 0.09  # [rad] 5 degrees: standard deviation of a direction, above which it is not told
    weighs: float = 0.1  # of its torque's RMS: a joint with less gravity has no share of its own
    friction_absent: float = 0.02  # of the torque's RMS: friction below is none; geared drives have 10 to 50 %, direct drives 3 %
    no_negative: float = 3.0  # times the noise of a channel: a torque below minus that is negative
    touches: int = 3  # times a signed torque does not come down to zero without once crossing it
