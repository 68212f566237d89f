"""The numbers that the bench chooses, with their meaning; those of a fault are in its class."""

from __future__ import annotations

from dataclasses import dataclass

SAMPLE_TIME = 1e-3  # numerics: [s] of every controller and log of the bench


@dataclass(frozen=True)
class BenchConfig:
    """Numbers of all machines of the bench."""

    command_bits: int = 12
    """Bits of the torque command over twice its limit: the D/A converter of Kostić et al. 2004,
    Section IV.A.
    """
    observer_noise: float = 3e-6
    """[rad] σ_η of the observer: 1e-5 rad/√12, the rounding of the encoder (Kostić et al. 2004,
    Section III.B).
    """
    observer_jerk: float = 4000.0
    """[rad/s^3] σ_ξ of the observer, of the order of the largest jerk of a reference (the same
    section).
    """
    inner_step: float = 2.5e-4
    """[s] largest step of RK4; a fifth of it moves a run by less than a hundredth of an encoder
    step.
    """
    largest_phase: float = 0.5
    """[1] largest step of RK4 times the highest rate of the machine: a fast motion is then followed
    closely.
    """
    runaway_speed: float = 1000.0
    """[rad/s] a loop that turns faster has run away."""
    motor_share: float = 0.2
    """[1] of a link's inertia about its axis that moves with its motor, at most."""
    motor_mass: float = 1e-9
    """[kg] of a motor as a body: its mass stays with the link, only its inertia turns by itself."""
    corner_hz: float = 0.6
    """[Hz] beyond it the amplitudes of speed of an excitation fall, or the acceleration limit would
    leave no speed.
    """
    fastest_turn: float = 9.42477796076938
    """[rad/s] 3π, largest speed of a reference: the limit of the paper's shoulder and elbow."""
    shortest_lag: float = 1e-3
    """[1] time constant of a lag over the step of its filter, below which it does nothing."""
    slowest_motion: float = 1e-3
    """[rad/s] a motion that needs too much torque is not shrunk to less than this speed."""
    least_gravity: float = 1e-9
    """[N m] less is no gravity, but the rounding of an upright axis."""
    healthy_cogging: float = 0.2
    """[1] largest cogging of a healthy joint, as a share of its amplifier's noise: that of the RRR
    arm's elbow.
    """
    healthy_ripple: float = 0.5
    """[1] largest torque that the gain ripple of a slide makes of its weight, as a share of the
    amplifier's noise.
    """


CONFIG = BenchConfig()
