"""A process that is held to some processors counts these, wherever they are counted."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.cli.commands import REPO

COUNTED = """
import json, os
from pipelines.io.processors import processors
from pipelines.selfcheck import examine
doctor = next(one.found for one in examine(with_self_test=False) if one.name == "processor")
print(json.dumps([doctor.split()[0], processors()]))
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system holds no process to processors")
def test_one_of_them() -> None:
    """The doctor and batches."""
    some = {min(os.sched_getaffinity(0))}
    done = subprocess.run([sys.executable, "-c", f"import os; os.sched_setaffinity(0, {some})\n{COUNTED}"], cwd=REPO, timeout=60,
                          capture_output=True, text=True, check=True)
    assert done.stdout == '["1", 1]\n'
