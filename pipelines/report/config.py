"""Numbers that decide how much of a result a report shows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REPORT"]


@dataclass(frozen=True)
class ReportConfig:
    """Limits of what is drawn and listed, so that a page stays short; result.json has all."""

    previews: int = 8  # logs whose signals `inspect` draws
    findings: int = 200  # that `inspect` lists
    reconstructed: int = 8  # logs whose motion is drawn
    simulated: int = 4  # logs whose simulation is drawn
    inputs: int = 40  # at the foot of a page
    headline: int = 240  # characters of a cause's line, of which the next action may be left out
    # relative torque error that is called good, and that explains too little to be used
    good_error: float = 0.1
    poor_error: float = 0.5
    sure: float = 3.0  # standard deviations, from which a value is clearly visible
    above_noise: float = 10.0  # times the noise between periods, from which the model lacks terms
    outstanding: float = 2.0  # times the relative error of all joints, from which one is named
    own_share: float = 2.0  # times the share of all joints, from which that of one joint is given
    coherent: float = 0.5  # coherence of measured points of a response that are drawn
    scaled_by: float = 0.3  # coherence of the points that set the scale of its axis
    method_off: float = 0.03  # relative, beyond noise, from which the report calls a method off
    good_speed: float = 0.05  # of the speed error without friction, that a good law leaves
    good_torque: float = 0.1  # of held-out torque, where nothing was simulated: the same
    near_rest: float = 0.04  # of the fastest speed, below which friction changes its sign
    chance: float = 6.0  # standard deviations; noise is further off in one sample of 5e8
    near_bound: float = 1.5  # times the bound of a condition number, up to which it is a percentage
    alike: float = 0.8  # similarity from which two causes explain the same
    much: float = 0.01  # relative change of a motion, that belongs into the verdict
    drawn_limit: float = 0.6  # of a limit, from which on the limit is drawn beside the signal
    fault_numbers: int = 3  # of a finding that `demo` tells, where it hid another


REPORT = ReportConfig()
