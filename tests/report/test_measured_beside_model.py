"""A model that lies on the measurement does not hide it: figures show both, whichever stage draws them."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.estimation.residual_analysis import Evidence
from pipelines.friction.result import Series
from pipelines.report import style
from pipelines.report.diagnosis_picture import residual_figures
from pipelines.report.figures import compared_figure
from pipelines.report.friction_report import _simulation_figure
from pipelines.report.render import render_report
from pipelines.report.report import Figure, Report, Section
from pipelines.report.words import Units
from tests.seeds import usually

T = np.linspace(0.0, 10.0, 500)
X = np.sin(T)
BOTH = np.stack([X, 2.0 * X], axis=1)
NONE = np.zeros(2)


def friction() -> Figure:
    still = np.zeros(3)
    series = Series(still, still, still, still, still, still, still, T, X, X, X, X, X, X, X, X, X, X)
    joint: Any = SimpleNamespace(joint=1, name="drawn", revolute=True, series=series)
    return _simulation_figure(joint)


def predicted() -> Figure:
    evidence = Evidence("log", T, BOTH, BOTH, 0.0 * BOTH, None, None, (), (), NONE, np.zeros((2, 2)), np.eye(2), np.eye(2))
    return next(figure for figure in residual_figures(evidence, "", Units()) if figure.name.startswith("torque-predicted"))


FIGURES = {
    "estimate-bps": lambda: compared_figure("drawn", "", T, BOTH, BOTH, "torque [N m]", "model", ("a", "b"), (
        ("friction", 0.0 * BOTH, style.GREEN), ("left", 0.0 * BOTH, style.BLACK))),
    "validate-writing": lambda: compared_figure("drawn", "", T, BOTH, BOTH, "position [rad]"),
    "fit-friction": friction, "diagnose": predicted}


def pixels(figure: Figure, colour: str) -> int:
    """How many pixels of the drawing, without its legend's rows, have `colour`."""
    from matplotlib import colors, image

    files = render_report(Report("", "", sections=(Section("", figures=(figure,)),)), {})
    drawn = image.imread(io.BytesIO(files[f"figures/{figure.name}.png"]), format="png")[..., :3]
    below = drawn[len(drawn) // 8:]
    return int((np.abs(below - np.array(colors.to_rgb(colour))).max(axis=-1) < 0.1).sum())


@pytest.mark.parametrize("stage", usually(FIGURES, "estimate-bps", "diagnose"))
def test_a_perfect_model_leaves_the_measurement_to_be_seen(stage: str) -> None:
    figure = FIGURES[stage]()
    assert pixels(figure, style.SKY) > 1000
    assert pixels(figure, style.VERMILLION) > 1000
