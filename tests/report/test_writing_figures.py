"""Figures of the writing task: what a pen would have written is told from its ways between strokes."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing

from pipelines.model.writing.cases import Case, TipStd, TipTrack
from pipelines.report.writing_figures import executed_figure

X = np.linspace(0.0, 1.0, 11)
PATH = np.stack([X, 0.0 * X, X**2], axis=1)
WAY = (X > 0.35) & (X < 0.65)  # between two strokes


def lines(drawn: np.ndarray | None) -> tuple[str, list[tuple[bool, np.ndarray]]]:
    """The caption, and of every line whether it is solid, and its points."""
    case = Case(1, (), TipStd(0.0, 0.0, 0.0), None, "measured", ("log",), TipTrack(PATH, PATH + 0.01, drawn))
    figure = executed_figure([case])
    assert figure is not None
    drawing = Drawing()
    figure.draw(drawing)
    return figure.caption, [(line.get_linestyle() == "-", np.asarray(line.get_xydata())) for line in drawing.axes[0].lines]


def test_ways_between_strokes_are_dashed() -> None:
    """No solid line runs where the pen is up, wanted or executed; dashed ones do, and the caption says what they are."""
    caption, found = lines((~WAY).astype(float))
    assert "dashed on the way between strokes" in caption
    for solid in (True, False):
        some = [points for kind, points in found if kind is solid]
        assert len(some) == 2
        for points in some:
            inside = (points[:, 0] > 0.38) & (points[:, 0] < 0.63)
            assert bool(inside.any()) is not solid


@pytest.mark.parametrize("drawn", [None, np.ones(len(X))])
def test_where_nobody_knows_of_a_pen_all_is_one_line(drawn: np.ndarray | None) -> None:
    caption, found = lines(drawn)
    assert "strokes" not in caption
    assert [(solid, len(points)) for solid, points in found] == [(True, len(X))] * 2
    assert np.isfinite(found[0][1]).all()


@pytest.mark.parametrize(("origins", "words"), [
    (("measured", "measured"), None), (("simulated", "simulated"), "All of them are simulated."),
    (("simulated", "measured"), "Simulated: case 1; measured: the others.")])
def test_letters_that_no_arm_has_written_are_called_simulated(origins: tuple[str, str], words: str | None) -> None:
    cases = [Case(k, (), TipStd(0.0, 0.0, 0.0), None, origin, ("log",), TipTrack(PATH, PATH, None))
             for k, origin in enumerate(origins, start=1)]
    figure = executed_figure(cases)
    assert figure is not None
    assert words in figure.caption if words else "imulated" not in figure.caption
