"""The covariance beside a model: there and back, and refused in words where it is damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io.model_file import read_covariance, write_covariance


def test_there_and_back(tmp_path: Path) -> None:
    """What is not determined comes back as NaN."""
    covariance = np.array([[1e-300, np.nan], [np.nan, 2.0]])
    write_covariance(tmp_path / "c.json", ("a", "µ"), covariance)
    names, found = read_covariance(tmp_path / "c.json")
    assert names == ("a", "µ")
    np.testing.assert_array_equal(found, covariance)


@pytest.mark.parametrize("text", ["", "[]", '{"names": ["a"], "covariance": [[1, 2]]}', "[" * 100_000])
def test_a_damaged_one_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(InputRejected, match="RRID-S18 .*c.json") as caught:
        read_covariance(tmp_path / "c.json")
    assert caught.value.remedy
