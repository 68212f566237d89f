"""What the tests of the command line share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.io.files import write_log
from tests.io.logs import small_log


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder `logs` with one good log."""
    write_log(tmp_path / "logs/a.h5", small_log())
    return tmp_path
