"""Where nothing was measured, nothing is drawn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from pipelines.report.diagnosis_picture import residual_figures
from pipelines.report.words import Units


def test_no_torque_is_drawn_across_a_gap() -> None:
    """Neither measured nor predicted: between the last row before it and the first behind it no line goes on."""
    t = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(1.4, 2.0, 0.01)])
    torque = np.sin(9.0 * t)[:, None]
    one: Any = SimpleNamespace(t=t, measured=torque, predicted=torque, residual=0.0 * torque, spectra=(), curves=(),
                               simulated_t=None)
    drawing = Drawing()
    residual_figures(one, "", Units())[0].draw(drawing)
    for line in drawing.axes[0].lines:
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        drawn = np.isfinite(y[:-1]) & np.isfinite(y[1:])
        assert drawn.sum() > 100
        assert np.diff(x)[drawn].max() < 0.05
