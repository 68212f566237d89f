"""The path of the tip: without a gap, in its plane, exact in arc length."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.writing.path import Page, TipPath, lay_out
from tests.writing.judge import OFFSETS, WEIGHTS

PAGE = Page(y=-0.37, x=0.05, z=0.6, height=0.11)
TEXT = "QUICK BROWN 0123456789 JSG"


@pytest.fixture(scope="module")
def path() -> TipPath:
    return lay_out(TEXT, PAGE)


def test_the_tip_stays_in_the_plane_and_the_text_in_the_middle(path: TipPath) -> None:
    """y is fixed, and the text's middle is where the page says."""
    tip = np.concatenate([piece.at(np.linspace(0, piece.length, 50))[0] for piece in path.pieces])
    assert (tip[:, 1] == PAGE.y).all()
    assert tip[:, 2].min() == pytest.approx(PAGE.z - PAGE.height / 2, abs=1e-12)
    assert tip[:, 2].max() == pytest.approx(PAGE.z + PAGE.height / 2, abs=1e-12)
    assert (tip[:, 0].min() + tip[:, 0].max()) / 2 == pytest.approx(PAGE.x, abs=1e-12)


def test_pieces_are_parametrised_by_arc_length(path: TipPath) -> None:
    """The derivative of the position is the unit tangent, that of the tangent the curvature: eighth-order differences."""
    h = 1e-3
    for piece in path.pieces:
        s = np.linspace(0.0, piece.length, 7)
        _, tangent, curvature = piece.at(s)
        there = [piece.at(s + k * h) for k in OFFSETS]
        assert np.abs(np.linalg.norm(tangent, axis=1) - 1.0).max() <= 1e-15
        slope, bending = (sum(w * x[i] for w, x in zip(WEIGHTS, there, strict=True)) / h for i in (0, 1))
        assert np.abs(slope - tangent).max() <= 1e-10
        assert np.abs(bending - curvature).max() <= 1e-8
        assert np.abs(np.linalg.norm(curvature, axis=1) - 1.0 / piece.radius).max() <= 1e-12
