"""The rigid body alone, for the ledger of a run: what friction takes away is not there where there is no friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import estimate_bps
from pipelines.io.files import write_log
from pipelines.simulation import example
from pipelines.stage import Request, read_logs


@pytest.mark.parametrize(("friction", "least", "most"), [((), 0.9, 1.3), (("coulomb:1:level=3",), 100.0, 1e4)])
def test_friction_that_is_there_is_missed(friction: tuple[str, ...], least: float, most: float, tmp_path: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    """Without friction the rigid body alone is as good as with friction's columns; with 3 N m at joint 1 far worse there."""
    monkeypatch.setattr(example, "_FRICTION", friction)
    for log in example.example_session():
        write_log(tmp_path / f"{log.name}.h5", replace(log))
    settings = estimate_bps.Settings()
    result = estimate_bps.compute(read_logs(Request((tmp_path,)), settings), settings)
    assert result.rigid_body_alone is not None
    assert least < result.rigid_body_alone[0] / result.torque_rms["validate"][0] < most
