"""The bars of the design, counted in evaluations instead of seconds. Long: run by name with pytest -m slow."""

from __future__ import annotations

import statistics
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.excitation.optimise import Effort, design, landscape
from pipelines.excitation.regressor import grams_of
from pipelines.excitation.result import judged
from pipelines.excitation.task import Wishes, plan_task
from pipelines.io.urdf import import_urdf
from tests.excitation.arms import described, rrr

pytestmark = pytest.mark.slow


def test_the_paper_s_problem() -> None:
    """100 harmonics, 13 parameters, limits of speed and acceleration: 1.30 at most in 9000 evaluations, some eight seconds of
    computing (median of three seeds), where the paper reached 3.1 and nothing is below 1.2247."""
    task = plan_task(rrr(), None, Wishes(criterion="condition", symmetric=True, rest=False, speed_share=1.0))
    found = [judged(task, design(task, Effort(evaluations=9000), seed), None, seed).condition_number for seed in (1, 2, 3)]
    assert min(found) >= np.sqrt(1.5)
    assert statistics.median(found) <= 1.30


def test_the_default_tells_more_than_the_smallest_condition_number() -> None:
    """Condition number 3 at most; predicted relative deviation at most half of the condition-optimal design's."""
    ratios = []
    for seed in (1, 2, 3):
        std = {}
        for criterion in ("default", "condition"):
            task = plan_task(rrr(), described(rrr()), Wishes(criterion=criterion))
            one = judged(task, design(task, Effort(evaluations=12000), seed), None, seed)
            std[criterion] = one.predicted_relative_std
            if criterion == "default":
                assert one.condition_number <= 3.0
        ratios.append(std["default"] / std["condition"])
    assert statistics.median(ratios) <= 0.5


def test_six_axes_beside_random_motions(shared: Path) -> None:
    """TX40 by its URDF, rigid and friction columns: a fifth of the median of 50 random motions within the same limits."""
    robot = import_urdf(shared / "real/tx40/tx40.urdf")
    task = plan_task(robot, Arm.from_links(robot), replace(Wishes(), criterion="condition", harmonics=(20,)))
    problem, rng, columns = landscape(task), np.random.default_rng(0), task.problem.columns
    random = []
    for _ in range(50):
        motion = problem.space.motion(problem.start(rng, 0.999), problem.samples)
        random.append(task.problem.goal.figures(grams_of(columns, motion)).condition_number)
    found = judged(task, design(task, Effort(evaluations=6000), 1), None, 1)
    assert found.condition_number <= statistics.median(random) / 5.0
