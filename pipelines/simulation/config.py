"""Numbers that decide how an arm is simulated and compared, each with its meaning and source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["COMMAND", "EXAMPLE", "SIMULATION"]


@dataclass(frozen=True)
class SimulationConfig:
    """Numbers of simulations, of their integrator's step, and of comparisons with logs."""

    # what can be simulated
    uneven: float = 0.05  # of a sample, by which a clock of a controller may be off its rate
    singular: float = 1e-10  # smallest over largest eigenvalue of an inertia matrix
    runaway: float = 1e4  # [rad], [rad/s]: no arm is ever there
    postures: int = 32  # of the reference, in which the inertia matrix is looked at
    few: int = 6  # robots that plain numbers move one by one faster than arrays move all
    most: int = 1000  # replicas, or steps a sample, that may be asked for
    # the step of the integrator
    steps: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64)  # a sample, that are tried
    stretch: float = 0.25  # [s] of a stretch in which they are tried
    share: float = 0.1  # of the difference that noise makes, which the step may add
    ample: int = 8  # steps a sample, where noise is what matters
    unheard: float = 1e-9  # [rad] that a step may be off, where nothing is random
    held: float = 5e-4  # [s] over which steps share one rigid body: a thousandth of it changes
    # windows
    window_error: float = 1e-7  # [rad] that a step may be off in a window
    windows_tried: int = 32
    windows_together: int = 256
    window_longest: float = 5.0  # [s]
    window_samples: int = 3  # at least
    # comparison of two arms with a measured one
    logs: int = 2  # that are simulated
    longest: float = 5.0  # [s] of a log in a closed loop
    longest_soft: float = 1.0  # [s] the same, where something beside the joints moves or remembers
    longer: float = 6.0  # times as long, where the last arm comes no nearer: noise averages out
    window: float = 0.1  # [s] of a window
    fine: float = 1e-3  # [s] between torques of a window: a faster log's are averaged
    exact: float = 1e-3  # of the position error, to which it is computed
    exact_soft: float = 1e-2  # the same, where something moves beside the joints
    still: float = 1e-4  # [rad or m] standard deviation of a joint that does not move
    blocks: int = 20  # of the time over which errors are added up
    # figures
    stretches: int = 500  # of which lowest and highest sample are drawn


@dataclass(frozen=True)
class ExampleConfig:
    """How the shipped arm moves in the logs of `rrrid demo`."""

    noise: tuple[float, ...] = (0.02, 0.01, 0.005)  # [N m] of the drives, std
    sample_time: float = 1e-3  # [s]
    period: float = 8.0  # [s]
    harmonics: int = 6
    speed: float = 2.2  # [rad/s] the fastest of each joint
    kp: tuple[float, ...] = (1500.0, 1100.0, 140.0)  # [N m/rad]
    kd: tuple[float, ...] = (45.0, 32.0, 3.2)  # [N m s/rad]
    observer_gain: tuple[float, ...] = (0.4156, 109.13, 14328.0)  # k of eq. (20)


@dataclass(frozen=True)
class CommandConfig:
    """When a logged torque counts as the command of the log's own controller."""

    longest: int = 6000  # samples that are followed, from the first on: an observer starts there
    fewest: int = 200
    latest: float = 0.1  # [s]
    late: float = 8e-3  # [s] a filter that is not described is later by less
    samples: int = 1  # nor is it known of one sample whose it is
    left: float = 0.05  # of the torque's standard deviation, that scale and time leave
    left_late: float = 0.015  # the same of one that is late: half the described damping leaves .021
    better: float = 3.0  # times what they leave, that the torque differs by as it stands
    scale: float = 1.3  # by which a description may err, or a constant of a drive
    scale_measured: float = 2.5  # by which a drive may
    lags: tuple[float, ...] = (0.5, 0.7, 1.0, 1.4)  # times how late it is, of an equal low-pass


COMMAND = CommandConfig()
EXAMPLE = ExampleConfig()
SIMULATION = SimulationConfig()
