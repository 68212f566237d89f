"""A derived log holds its recording unharmed, and says truly what it was derived from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import RrridError
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, derive, derived_by, digest_of, recording
from tests.healthy import changed
from tests.io.logs import random_log, small_log

SETTINGS = {"method": "smoother", "order": 3, "jerk_std": (1.0, 2.5), "bandwidth": None}


def richer(log: ExperimentLog, settings: dict[str, object] | None = None) -> ExperimentLog:
    rng = np.random.default_rng(0)
    names = ("q_hat", "dq_hat", "ddq_hat", "q_hat_std", "dq_hat_std", "ddq_hat_std")
    return derive(log, "reconstruct", settings or SETTINGS, {name: rng.standard_normal(log.q.shape) for name in names})


@pytest.mark.parametrize("ending", ["h5", "parquet"])
@pytest.mark.parametrize("seed", range(5))
def test_the_recording_comes_back_bit_for_bit(ending: str, seed: int, tmp_path: Path) -> None:
    """Written in either container and read again: samples, attributes, robot and digest are those of the recording."""
    log = random_log(np.random.default_rng(seed))
    write_log(tmp_path / f"a.{ending}", richer(log))
    back = open_log(tmp_path / f"a.{ending}").log
    assert recording(back) == log
    assert digest_of(recording(back)) == digest_of(log)
    assert derived_by(back, "reconstruct", SETTINGS)


def test_nothing_but_the_same_settings_and_the_same_recording_fits() -> None:
    log = richer(small_log())
    assert derived_by(log, "reconstruct", SETTINGS)
    assert not derived_by(small_log(), "reconstruct", SETTINGS), "nothing was derived"
    assert not derived_by(log, "reconstruct", SETTINGS | {"order": 4})
    assert not derived_by(log, "reconstruct", {"method": "smoother"})
    assert not derived_by(log, "diagnose", SETTINGS)
    assert not derived_by(changed(log, "tau", (0, 0), 7.0), "reconstruct", SETTINGS)
    assert not derived_by(replace(log, sample_time=log.sample_time * 2), "reconstruct", SETTINGS)


def test_a_derived_sample_that_was_changed_in_the_file_is_noticed(tmp_path: Path) -> None:
    """The file's digest covers derived signals: a tampered q_hat is never read."""
    import h5py

    write_log(tmp_path / "a.h5", richer(small_log()))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["signals/q_hat"][0, 0] += 1.0
    with pytest.raises(RrridError, match="F04"):
        open_log(tmp_path / "a.h5")
