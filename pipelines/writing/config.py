"""Numbers that decide in the writing task, each with its meaning and its source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CONFIG", "WritingConfig"]


@dataclass(frozen=True)
class WritingConfig:
    """Of the task, of its inverse kinematics and of the validation."""

    # the task
    longest: int = 200  # letters: minutes of writing, seconds of planning
    longest_sample_time: float = 0.1  # [s] of a reference
    # inverse kinematics
    border: float = 0.005  # [m] from the border of the workspace, where joint speeds diverge
    # control cases
    same_reference: float = 1e-6  # [rad] by which references of one task differ: rounding
    most_draws: int = 1000  # of models on which cases are simulated
    shared: float = 0.9  # of the longer log: recorders start and stop by hand, while the arm rests
    # figures
    points: int = 3000  # of a curve
    track_points: int = 2000  # of a path of the tip
    drawn_logs: int = 4  # whose torques are kept for figures


CONFIG = WritingConfig()
