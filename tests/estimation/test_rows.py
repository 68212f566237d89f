"""Rows of logs: what is done to a signal there is what scipy's filters do, and alike for torque and columns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from pipelines.dynamics.body import Motion
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.nominal import _orthonormal, fit_nominal, rows_of
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.estimation.rows import Data
from tests.diagnosis.arms import arm, hidden


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs((hidden(1), hidden(2))), Recipe())


@pytest.mark.parametrize(("chosen", "step"), [(None, 10.0), (100.0, 2.5)])
def test_rows_are_those_of_a_zero_phase_butterworth(prepared: Prepared, chosen: float | None, step: float) -> None:
    """A column through the rows is the same column through scipy's sosfiltfilt, averaged as a held command is; rows may lie
    between samples."""
    one = (prepared if chosen is None else prepare(Logs((hidden(1),)), Recipe(cutoff_hz=chosen))).data.logs[0]
    assert np.diff(one.t) == pytest.approx(step * 1e-3)
    cutoff = one.equations.conditioning.cutoff_hz
    assert cutoff is not None
    x = one.motion.dq[:, 0] * one.motion.q[:, 1]
    fine = np.interp(np.arange(10 * len(x)) / 10.0, np.arange(len(x)), x)  # the average over two samples, by a finer grid
    average = np.convolve(fine, np.ones(20) / 20.0, mode="same")[::10]
    smooth = sosfiltfilt(butter(4, cutoff, fs=1000.0, output="sos"), average)
    rows = one.lay(np.stack([x, x, x], axis=1))[0]
    expected = np.interp(one.t, one.motion.t, smooth)
    inside = slice(20, -20)
    assert np.abs(rows[inside] - expected[inside]).max() < 2e-3 * np.abs(x).max()


@pytest.mark.parametrize("by", [-2, 1, 3])
def test_a_signal_is_moved_by_rows_within_each_log_and_joint(prepared: Prepared, by: int) -> None:
    data = prepared.data
    x = 1.0 + np.arange(data.rows, dtype=float)
    for now, then in zip(data.split(x), data.split(data.moved(x, by)), strict=True):
        kept, gone = (slice(by, None), slice(None, by)) if by > 0 else (slice(None, by), slice(by, None))
        there = slice(None, -by) if by > 0 else slice(-by, None)
        assert np.array_equal(then[:, kept], now[:, there])
        assert not then[:, gone].any()


def test_a_held_command_is_centred(prepared: Prepared) -> None:
    """What a drive gave on average over a sample lies in the middle of it: the modelled torque fits the rows of the command."""
    truth = prepared.data.lay(arm().torque)
    assert (prepared.data.rms(prepared.data.y - truth) < np.array([0.012, 0.006, 0.004])).all()


def test_no_row_hangs_on_torque_beyond_the_limit_of_a_drive() -> None:
    """Peaks of eight times the limit, of which nobody knows whether the drive gave them: what stands in their place differs by so
    much that the low-pass carries it farther than a bad sample. No row that is left shows it; and most rows are left."""
    def peaks(motion: Motion) -> np.ndarray:
        load = np.zeros_like(motion.q)
        for at in (2.0, 4.5, 6.2):
            load[:, 0] += 500.0 * np.exp(-0.5 * ((motion.t - at) / 0.02) ** 2)
        return load

    there = prepare(Logs((hidden(1, peaks), hidden(2))), Recipe()).data
    truth = there.lay(lambda motion: arm().torque(motion) + peaks(motion) * (motion.t[-1] == there.logs[0].motion.t[-1]))
    own = there.counts & (there.log_of == 0)
    left = (there.y - truth)[own & (there.joint == 0)]
    assert np.abs(left).max() < 0.03  # noise leaves 6 mN m
    assert there.logs[0].rows > 0.6 * there.logs[1].rows


@pytest.mark.parametrize("cutoff_hz", [10.0, 25.0])
def test_frequent_peaks_leave_rows_of_every_joint(cutoff_hz: float) -> None:
    """Torque of joint 1 is beyond its limit every 0.4 s: of the others no row hangs on it, and of its own some stay."""
    def peaks(motion: Motion) -> np.ndarray:
        load = np.zeros_like(motion.q)
        for at in np.arange(0.3, 8.0, 0.4):
            load[:, 0] += 300.0 * np.exp(-0.5 * ((motion.t - at) / 0.01) ** 2)
        return load

    data = prepare(Logs((hidden(1, peaks), hidden(2))), Recipe(cutoff_hz=cutoff_hz)).data
    assert all(one.weighed.any(axis=1).all() for one in data.logs if one.rows)
    assert data.logs[0].weighed[1:].all()


def test_logs_and_joints_follow_each_other(prepared: Prepared) -> None:
    data = prepared.data
    assert data.rows == sum(3 * one.rows for one in data.logs)
    parts = list(data.split(data.y))
    np.testing.assert_array_equal(parts[1][2], data.y[(data.log_of == 1) & (data.joint == 2)])


def test_blocks_hold_all_joints_of_a_moment(prepared: Prepared) -> None:
    data = prepared.data
    place = data.blocks(10)
    for log in range(2):
        own = [place[(data.log_of == log) & (data.joint == j)] for j in range(3)]
        np.testing.assert_array_equal(own[0], own[1])
        np.testing.assert_array_equal(own[0], own[2])
    assert not np.intersect1d(place[data.log_of == 0], place[data.log_of == 1]).size


def test_friction_and_its_sharpness_are_found(prepared: Prepared) -> None:
    """The nominal model is the truth here: Coulomb, viscous, and how sharply friction changes sign, within a few per cent."""
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    sharp = [law.sharpness for law in columns.laws if law.name == "coulomb"]  # type: ignore[attr-defined]
    np.testing.assert_allclose(sharp, 100.0, rtol=0.05)
    assert (fit.rms < np.array([0.012, 0.006, 0.004])).all()


def test_what_the_model_can_imitate_is_projected_away(prepared: Prepared) -> None:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    own = rows_of(prepared.data, columns)
    assert np.abs(fit.project(own)).max() < 1e-6 * np.abs(own * fit.weights).max()
    basis = _orthonormal(own * fit.weights)
    np.testing.assert_allclose(basis @ basis.T, np.eye(len(basis)), atol=1e-9)


def test_data_less_a_known_torque(prepared: Prepared) -> None:
    """A torque that is known is taken off the measured one."""
    data = prepared.data
    known = np.full(data.rows, 0.5)
    np.testing.assert_allclose(Data(data.logs, known=known).y, data.y - 0.5)
