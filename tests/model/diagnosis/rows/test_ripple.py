"""The ripple of drives as noise of the rows: white by the covariance written out, and numbers that fit motion farther out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.rows.whitening import Whitening
from pipelines.model.diagnosis.searched.beside import less
from pipelines.model.diagnosis.worth.held_out import cross_validated
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import arm, hidden
from tests.model.estimation.experiments import motion_of

SIZE, ORDERS = 1e-3, range(6, 40)  # a thousandth of the torque, as many waves a turn as drives have
DRAWS = 12


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs((hidden(1),)), DiagnosisSettings())


def nominal(prepared: Prepared, steady: bool) -> Refined:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return refine(Exact.start(columns, fit), replace(prepared.data, steady=steady), fit.weight)


@pytest.mark.parametrize("joint", range(3))
def test_what_comes_out_is_white(prepared: Prepared, joint: int) -> None:
    """E[e_i e_k] = δ_ik + w² r² τ_i τ_k / 2M Σ_m cos m(q_i - q_k), the waves' random amplitudes averaged by hand."""
    data = replace(prepared.data, steady=True)
    assert data.ripple is not None
    weight = np.array([50.0, 80.0, 150.0])
    own = np.flatnonzero(data.joint == joint)[::3]
    q = motion_of(1)(data.t[own]).q[:, joint]
    apart = np.sum([np.cos(m * (q[:, None] - q)) for m in ORDERS], axis=0)
    covariance = np.eye(len(own)) + (weight[joint] * SIZE) ** 2 * np.outer(data.y[own], data.y[own]) * apart / (2 * len(ORDERS))
    some = replace(data.ripple, rows=tuple(rows[::3] if j == joint else rows[:0] for j, rows in enumerate(data.ripple.rows)),
                   **_thinned(data.ripple.basis, data.ripple.size, joint))
    table = np.zeros((len(own), data.rows))
    table[:, own] = np.linalg.cholesky(covariance).T
    out = some.out_of(table, weight)[:, own]
    assert float(np.abs(covariance - np.eye(len(own))).max()) > 0.02  # there is something to take out
    np.testing.assert_allclose(out.T @ out, np.eye(len(own)), atol=5e-3)


def _thinned(basis: tuple[Array, ...], size: tuple[Array, ...], joint: int) -> dict[str, tuple[Array, ...]]:
    """The decomposition of every third row of one joint, from that of all."""
    u, s, _ = np.linalg.svd((basis[joint] * size[joint])[::3], full_matrices=False)
    return {"basis": tuple(u if j == joint else b[:0, :0] for j, b in enumerate(basis)),
            "size": tuple(s if j == joint else x[:0] for j, x in enumerate(size))}


def test_rows_that_were_whitened_have_the_ripple_whitened(prepared: Prepared) -> None:
    """A log's own ripple, an eighth wave of joint 2, is of the same share inside what is taken out, white rows or not."""
    data = prepared.data
    joint = data.joint == 1
    q = np.concatenate([one.at_rows(one.motion.q)[:, 1] for one in data.logs])
    wave = np.zeros(data.rows)
    wave[joint] = SIZE * data.y[joint] * np.cos(8.0 * q)
    white = Whitening.of(data, np.cumsum(np.random.default_rng(5).standard_normal((3, data.rows)), axis=1) * 1e-3)
    weight = np.full(3, 1e6)
    for rows, x in ((data, wave), (data.whitened(white), data.through(white, wave[None])[0])):
        ripple = replace(rows, steady=True).ripple
        assert ripple is not None
        assert np.linalg.norm(ripple.out_of(x * 1e6, weight)) < 0.02 * np.linalg.norm(x * 1e6)


def test_rows_that_are_cleared_are_so_in_torque_and_columns_alike(prepared: Prepared) -> None:
    """Of all joints at once or of one by itself; a torque that is known goes with the rest."""
    data, weight = prepared.data, np.array([50.0, 80.0, 150.0])
    white = Whitening.of(data, np.random.default_rng(5).standard_normal((3, data.rows)))
    known = np.random.default_rng(6).standard_normal(data.rows)
    there = replace(data, known=known).whitened(white, weight)
    assert there.cleared is not None
    ripple = there.cleared[0]
    np.testing.assert_allclose(there.y, ripple.out_of(data.through(white, data.y - known), weight), atol=1e-9)
    torque = arm().torque
    np.testing.assert_allclose(there.lay(torque), ripple.out_of(data.whitened(white).lay(torque), weight), atol=1e-9)
    np.testing.assert_allclose(less(there, there.lay(torque)).y, there.y - there.lay(torque), atol=1e-12)
    twice = less(less(there, there.lay(torque)), there.lay(torque))
    np.testing.assert_allclose(twice.y, there.y - 2.0 * there.lay(torque), atol=1e-12)
    own = np.flatnonzero(data.joint != 1)
    np.testing.assert_allclose(there.clear(known[own], own), there.clear(known)[own], atol=1e-12)
    assert there.clear(np.zeros((3, 2, 0)), own[:0]).shape == (3, 2, 0)  # of a cause that acts at no joint


@pytest.mark.slow
def test_numbers_of_a_rippling_drive_fit_motion_farther_out() -> None:
    """Twelve arms whose drives ripple by a thousandth, over 8 s: the torque of four other motions, without noise or ripple, is told
    with less error than by rows weighed alike at joint 2, which carries the arm, and with no more at the others; where nothing
    ripples, with no more at any."""
    far = [motion_of(seed)(np.arange(0.0, 10.0, 0.01)) for seed in range(77, 81)]
    truth = [arm().torque(one) for one in far]
    errors = [[_errors(_rippling(draw, size), far, truth) for draw in range(DRAWS)] for size in (SIZE, 0.0)]
    mean = np.sqrt(np.mean(np.square(errors), axis=(1, 3)))  # (ripple or none, alike or steady, joints)
    assert mean[0, 1, 1] < 0.95 * mean[0, 0, 1], mean
    assert (mean[:, 1] < 1.05 * mean[:, 0]).all(), mean


def _rippling(draw: int, size: float) -> Prepared:
    rng = np.random.default_rng([6, draw])
    order, phase = rng.integers(8, 37, 3), rng.uniform(-np.pi, np.pi, 3)

    def load(motion: Motion) -> Array:
        return np.asarray(size * arm().torque(motion) * np.sin(order * motion.q + phase))

    return prepare(Logs((hidden(20 + draw, load),)), DiagnosisSettings())


def _errors(prepared: Prepared, motions: list[Motion], truth: list[Array]) -> Array:
    """(alike or steady, motions, joints) [N m] rms."""
    arms = [nominal(prepared, steady).model.arm for steady in (False, True)]
    return np.array([[np.sqrt(np.mean(np.square(one.torque(motion) - known), axis=0))
                      for motion, known in zip(motions, truth, strict=True)] for one in arms])


def test_a_block_is_left_by_what_the_rest_asks_for(prepared: Prepared) -> None:
    """Generalised least squares of the other rows alone, their covariance written out and inverted as it stands."""
    done = nominal(prepared, True)
    data, weights, blocks = done.data, done.weights, 5
    assert data.ripple is not None
    covariance = np.eye(data.rows)
    for rows, waves in data.ripple.waves(done.weight):
        covariance[np.ix_(rows, rows)] += waves @ waves.T
    table, y, place = done.slopes * weights, done.residual, data.blocks(blocks)
    exact = np.empty(data.rows)
    for block in range(place.max() + 1):
        rest = np.flatnonzero(place != block)
        white = np.linalg.solve(np.linalg.cholesky(covariance[np.ix_(rest, rest)]), np.column_stack([table[:, rest].T, y[rest]]))
        shift = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)[0]
        exact[place == block] = (y - shift @ table)[place == block]
    np.testing.assert_allclose(cross_validated(done, blocks), exact / weights, atol=2e-6)
