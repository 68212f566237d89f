"""Numbers that decide in the design of experiments, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CONFIG", "ExcitationConfig", "Round"]


@dataclass(frozen=True)
class Round:
    """One minimisation in a series of ever sharper ones."""

    sharpness: float  # p of the smooth criterion
    weight: float  # of the barrier
    iterations: int  # at most


@dataclass(frozen=True)
class ExcitationConfig:
    """Of the excitation, and of the other experiments."""

    # the equations
    sharpness: float = 20.0  # [s/rad] of Coulomb friction: a change of sign takes several samples
    noise: float = 0.01  # of the torque limit: std of the torque where nothing better is known
    small: float = 0.005  # of the largest of its unit: a smaller parameter is compared with this
    coulomb: float = 0.05  # of the torque limit at rest: friction where no model says
    viscous: float = 0.05  # of the torque limit at full speed, the same
    ceiling: float = 3.0  # condition number of the default criterion (shared/excitation.md)
    steep: float = 10.0  # slope of the penalty above the ceiling: outweighs what A or D could gain
    # harmonics
    knee_hz: float = 0.6  # where inertia begins to outweigh gravity
    most_harmonics: int = 2000  # of the common period
    top_hz: float = 10.0  # of a direct drive (Kostić et al. 2004, Section IV.C.3)
    geared_top_hz: float = 2.0  # of any other arm, whose gears bend earlier
    fewest_harmonics: int = 2
    # the search (shared/excitation.md, method)
    coarse: tuple[Round, ...] = (Round(4, 2e-2, 30), Round(16, 5e-3, 50), Round(64, 2e-3, 60))
    lifted: tuple[Round, ...] = (Round(32, 4e-3, 40), Round(128, 1e-3, 80), Round(400, 3e-4, 120))
    again: tuple[Round, ...] = (Round(32, 2e-3, 40), Round(128, 5e-4, 100), Round(600, 1e-4, 150))
    final: tuple[Round, ...] = (Round(600, 1e-4, 60), Round(2000, 2e-5, 120),
                                Round(6000, 4e-6, 150), Round(20000, 1e-6, 200))
    starts: int = 8  # on the coarse problem
    lifted_starts: int = 2  # of them, that are refined on the fine one
    pool: int = 5  # points that are disturbed and refined again
    turns: tuple[tuple[int, float], ...] = ((0, 0.03), (1, 0.03), (0, 0.08), (2, 0.05))
    # of a pool member, the best being 0, and the relative size of its disturbance
    final_evaluations: tuple[int, int] = (200, 600)  # between them a tenth of the search's
    coarse_density: int = 8  # samples of a period for each harmonic
    density: int = 10
    final_density: int = 20
    fewest_samples: int = 200  # of a period: fewer do not show what friction does
    share: int = 5  # the coarse problem has so small a share of the harmonics
    roomy: float = 0.7  # of the limits, to which a random start is scaled
    # limits
    grid: float = 1e-4  # [s] on which a finished motion is verified
    corner: float = 0.9999  # of a limit, from which the barrier is a parabola
    room: float = 0.998  # of the limits, in which is searched: a motion is larger between samples
    run_in: tuple[float, float, float] = (0.2, 10.0, 1.15)  # [s] fastest, longest; a step's factor
    # discrimination of two causes
    steep_friction: float = 200.0  # [s/rad] of Coulomb friction, in what the nominal model imitates
    shapes: int = 4  # of a cause with non-linear numbers
    hidden: float = 0.1  # a cause of which less shows has to show more first
    rank: float = 1e-8  # relative eigenvalue of columns that are one
    # the other experiments
    levels: int = 9  # speeds over two decades
    speed_share: float = 0.8  # of the speed limit
    acceleration: float = 0.4  # of the acceleration that limits allow
    held: tuple[float, float] = (0.15, 3.0)  # [s] a speed is held: longer says no more
    used_range: float = 0.8  # of the position range
    slow: float = 0.05  # of the speed limit: the turn of an frf experiment
    frf_torque: float = 0.1  # of the torque limit, rms of the excitation
    frf_period: float = 8.0  # [s] odd lines then lie a quarter of a hertz apart
    frf_periods: int = 2  # each way at least, to tell noise
    frf_settle: float = 1.0  # [s] before them, in which the loop settles
    realisations: int = 2  # of other phases, on whose mean nonlinear distortion is smaller
    frf_band: tuple[float, float] = (1.0, 0.4)  # [Hz] lowest line; highest, of the sample rate
    slower: float = 0.8  # a plan that breaks a limit is made slower in such steps
    slowest: float = 0.05
    # figures
    points: int = 1000  # of a curve


CONFIG = ExcitationConfig()
