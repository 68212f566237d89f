"""Numbers that decide how a model is exported, each with its meaning and source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EXPORT"]


@dataclass(frozen=True)
class ExportConfig:
    """Limits of the proof, and the range where neither logs nor description say one."""

    states: int = 1000  # random states at which the exported file is compared
    seed: int = 1  # of the states and of the motion
    agreement: float = 1e-9  # largest relative difference of torque that is rounding
    samples: int = 5000  # of the motion on which an approximation is measured
    rate: float = 500.0  # [Hz] of that motion
    waves: int = 5  # sines a joint in that motion
    speed: float = 1.0  # [rad/s] of states where neither model nor description has a range
    acceleration: float = 10.0  # [rad/s^2] the same
    travel: float = 0.5  # [m] the same, of a prismatic joint
    explained: float = 0.5  # share of a cause that columns of the target must hold: else it is lost
    standard_gravity: float = 9.81  # [m/s^2] what readers of a URDF take
    unlimited: float = 1e9  # [N m, rad/s, m] for a limit that a URDF must have, and nobody knows
    # [s] of MuJoCo's dry friction: its own, 0.02, lets joints creep; a simulated log of the test
    # bench is then 17 % farther off than by the model, and 4 % with this one
    friction_time: float = 0.004
    mujoco: str = "3.3.1"  # the oldest that the extra `export` allows: it reads all but polynomials
    # whose joints have polynomials of damping and stiffness: 3.6 refuses them, 3.7 reads them
    mujoco_polynomials: str = "3.7"
    window: float = 0.1  # [s] over which a log is simulated from its own states
    compile_seconds: float = 120.0  # [s] until a compiler is given up


EXPORT = ExportConfig()
