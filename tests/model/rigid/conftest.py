"""The arms every test of the general recursion runs on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.model.rigid.serial_arms import ARMS, Arm


@pytest.fixture(scope="module", params=list(ARMS))
def arm(request: pytest.FixtureRequest, shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return ARMS[request.param](shared, tmp_path_factory.mktemp("urdf"))
