"""The path of the tip: without a gap, in its plane, exact in arc length."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipelines.writing.path import Page, TipPath, lay_out
from tests.writing.judge import OFFSETS, WEIGHTS

PAGE = Page(y=-0.37, x=0.05, z=0.6, height=0.11)
TEXT = "QUICK BROWN 0123456789 JSG"


@pytest.fixture(scope="module")
def path() -> TipPath:
    return lay_out(TEXT, PAGE)


def test_the_tip_never_jumps(path: TipPath) -> None:
    """Each piece starts where the one before it ended, to rounding."""
    ends = [piece.at(np.array([0.0, piece.length]))[0] for piece in path.pieces]
    assert max(np.abs(b[0] - a[1]).max() for a, b in pairwise(ends)) <= 1e-15


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


def test_corners_and_bends_are_told_apart() -> None:
    """L has a corner, J passes into its arc; in an 8 the curvature alone changes."""
    assert lay_out("L", PAGE).joints == ("corner",)
    assert lay_out("J", PAGE).joints == ("bend",)
    assert lay_out("8", PAGE).joints == ("bend",)
    assert lay_out("3", PAGE).joints == ("corner",)


def test_a_lifted_tip_leaves_the_plane_between_strokes_only() -> None:
    """With a lift, moves between strokes leave the plane by it, and what is drawn stays in it."""
    pieces = lay_out("THE", Page(lift=0.02)).pieces
    moves = np.concatenate([piece.at(np.linspace(0, piece.length, 9))[0] for piece in pieces if not piece.drawn])
    drawn = np.concatenate([piece.at(np.linspace(0, piece.length, 9))[0] for piece in pieces if piece.drawn])
    assert np.ptp(drawn[:, 1]) == 0.0
    assert np.ptp(moves[:, 1]) == pytest.approx(0.02)
    flat = [piece.length for piece in lay_out("THE", Page()).pieces if piece.drawn]
    assert [piece.length for piece in pieces if piece.drawn] == flat
