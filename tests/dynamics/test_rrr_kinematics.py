"""The inverse kinematics of the RRR arm: every branch, every border, and the points that cannot be reached."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.body import Array
from pipelines.dynamics.rrr_kinematics import (
    BRANCHES,
    Geometry,
    Reach,
    inverse,
    rrr_geometry,
    tip,
)
from pipelines.io.robot_files import load_robot

KINDS = {
    "regular": {Reach.REACHABLE},
    "singular_elbow": {Reach.ELBOW},
    "singular_shoulder_W0": {Reach.SHOULDER},
    "unreachable_inner_cylinder": {Reach.INSIDE_CYLINDER},
    "unreachable_outer": {Reach.TOO_FAR},
    "unreachable_inner_shell": {Reach.TOO_NEAR},
}


@pytest.fixture(scope="module")
def geometry() -> Geometry:
    return rrr_geometry(load_robot("rrr"))


def test_random_tips_by_all_branches(geometry: Geometry) -> None:
    """1e5 random reachable tips: all four branches lead back to the tip within 1e-12 m."""
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (100_000, 3))
    x = tip(geometry, q)
    answer = inverse(geometry, x)
    assert answer.reachable.all()
    assert max(float(np.abs(tip(geometry, branch) - x).max()) for branch in answer.q) <= 1e-12
    assert np.abs(answer.q).max() <= np.pi
    apart = np.abs(angle(answer.q - q)).max(axis=-1).min(axis=0)
    regular = np.abs(determinant(geometry, q)) > 1e-3
    assert apart[regular].max() <= 1e-12


def test_reference_cases(geometry: Geometry, vectors: dict[str, Any]) -> None:
    """Every case of the reference vectors: the same branches in the same order, the same verdict on the rest."""
    for case in vectors["ik"]:
        answer = inverse(geometry, np.array([case["tip"]]))
        assert Reach(int(answer.status[0])) in KINDS[case["kind"]], (case["kind"], answer.words(0))
        assert [(b["shoulder"], b["elbow"]) for b in case["branches"]] == list(BRANCHES)
        for ours, theirs in zip(answer.q[:, 0], case["branches"], strict=True):
            assert theirs["ok"] == np.isfinite(ours).all()
            if theirs["ok"]:
                # Where branches merge the angles are only as good as the root of rounding; the tip is exact.
                close = 1e-12 if case["kind"] == "regular" else 1e-6
                assert np.abs(angle(ours - np.array(theirs["q"]))).max() <= close
                assert np.abs(tip(geometry, ours) - np.array(case["tip"])).max() <= 1e-12


@pytest.mark.parametrize(("q", "status"), [
    ([0.3, 0.4, 0.0], Reach.ELBOW), ([0.3, 0.4, np.pi], Reach.ELBOW), ([-2.0, -1.0, 0.0], Reach.ELBOW)])
def test_elbow_singularities(geometry: Geometry, q: list[float], status: Reach) -> None:
    """A stretched and a folded elbow: two branches merge, and the answer says so."""
    answer = inverse(geometry, tip(geometry, np.array([q])))
    assert answer.status[0] == status
    assert answer.singular.all()
    assert "elbow" in answer.words(0)
    assert np.abs(angle(answer.q[0] - answer.q[1])).max() < 1e-5


def test_shoulder_singularities(geometry: Geometry) -> None:
    """A tip on the cylinder of radius d about the first axis: front and back are one."""
    q2 = np.linspace(-2.5, 2.5, 41)
    q3 = np.arccos(-geometry.a2 / geometry.a3 * np.cos(q2)) - q2  # a2 cos q2 + a3 cos(q2 + q3) = 0
    x = tip(geometry, np.stack([np.full_like(q2, 0.7), q2, q3], axis=-1))
    answer = inverse(geometry, x)
    assert np.isin(answer.status, [Reach.SHOULDER, Reach.SHOULDER_AND_ELBOW]).all()
    assert max(float(np.abs(tip(geometry, branch) - x).max()) for branch in answer.q) <= 1e-12


def test_just_outside_is_rounding_and_farther_is_not(geometry: Geometry) -> None:
    """1e-14 m beyond the border still counts, 1e-6 m does not, and NaN is nowhere."""
    stretched = tip(geometry, np.array([[0.0, 0.5, 0.0]]))
    shoulder = np.array([0.0, -geometry.d, geometry.d1])
    along = (stretched - shoulder) / np.linalg.norm(stretched - shoulder)
    beyond = [stretched + 1e-14 * along, stretched + 1e-6 * along, stretched * np.nan]
    answer = inverse(geometry, np.concatenate(beyond))
    assert answer.reachable.tolist() == [True, False, False]
    assert np.isnan(answer.q[:, 1:]).all()
    assert "farther" in answer.words(1)
    assert "not a number" in answer.words(2)


def angle(q: Array) -> Array:
    """`q` as the nearest angle to zero."""
    return np.asarray((q + np.pi) % (2 * np.pi) - np.pi)


def determinant(geometry: Geometry, q: Array) -> Array:
    """det J = -a2 a3 sin q3 (a2 cos q2 + a3 cos(q2 + q3)), `verified.md` section 2."""
    _, q2, q3 = q.T
    a2, a3 = geometry.a2, geometry.a3
    return np.asarray(-a2 * a3 * np.sin(q3) * (a2 * np.cos(q2) + a3 * np.cos(q2 + q3)))
