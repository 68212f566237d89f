"""Figures of the writing task."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.report.writing_figures import executed_figure
from pipelines.writing.control_cases import Case, TipStd, TipTrack

X = np.linspace(0.0, 1.0, 11)
PATH = np.stack([X, 0.0 * X, X**2], axis=1)


@pytest.mark.parametrize(("origins", "words"), [
    (("measured", "measured"), None), (("simulated", "simulated"), "All of them are simulated."),
    (("simulated", "measured"), "Simulated: case 1; measured: the others.")])
def test_letters_that_no_arm_has_written_are_called_simulated(origins: tuple[str, str], words: str | None) -> None:
    cases = [Case(k, (), TipStd(0.0, 0.0, 0.0), None, origin, ("log",), TipTrack(PATH, PATH))
             for k, origin in enumerate(origins, start=1)]
    figure = executed_figure(cases)
    assert figure is not None
    assert words in figure.caption if words else "imulated" not in figure.caption
