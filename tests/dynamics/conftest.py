"""The arms every test of the general recursion runs on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.dynamics.serial_arms import ARMS, Arm
from tests.seeds import usually


@pytest.fixture(scope="module", params=usually(ARMS, "rrr", "stanford", "gantry-mdh", "skew-urdf", "seven-joints"))
def arm(request: pytest.FixtureRequest, shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return ARMS[request.param](shared, tmp_path_factory.mktemp("urdf"))
