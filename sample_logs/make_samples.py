"""Make the sample logs and the example model: python -m sample_logs.make_samples [FOLDER…]

Every run gives the same logs, digest by digest; those of the virtual test bench, which take some
minutes, with the same MuJoCo and where LAPACK rounds the same (`rounds_alike`): its code differs
from processor to processor, and dry friction makes a count of an encoder of a last bit. With
folders named, only these are made.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version

from bench.config import SAMPLE_TIME
from bench.dynamics import build
from bench.plan import plan_of
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from sample_logs.bench_session import machine
from sample_logs.make_changed import changed_logs
from sample_logs.make_closed_form import closed_form_logs
from sample_logs.make_healthy import healthy_logs
from sample_logs.make_model import HERE, example_text

FOLDERS: dict[str, Callable[[], Iterator[tuple[str, ExperimentLog]]]] = {
    "rrr-closed-form": lambda: iter(closed_form_logs().items()),
    "rrr-healthy": healthy_logs,
    "rrr-changed": changed_logs,
}


def main(names: list[str]) -> None:
    """Make these folders, or all.

    Raises:
        KeyError: there is no such folder.
    """
    chosen = {name: FOLDERS[name] for name in names or FOLDERS}
    (HERE / "models").mkdir(exist_ok=True)
    (HERE / "models" / "rrr.json").write_text(example_text(), encoding="utf-8")
    for name, logs in chosen.items():
        (HERE / name).mkdir(exist_ok=True)
        for file, log in logs():
            write_log(HERE / name / file, log)
            print(f"{name}/{file}", flush=True)


def rounds_alike() -> bool:
    """Return whether MuJoCo and LAPACK round here as they did for the committed logs of the bench.

    LAPACK is judged by the digest of the principal axes of the machine's bodies.
    """
    model = build(plan_of(machine().robot), SAMPLE_TIME).model
    axes = hashlib.sha256(model.body_inertia.tobytes() + model.body_iquat.tobytes()).hexdigest()
    return version("mujoco") == "4.0.0" and axes.startswith("7a1fa61904f35503")


if __name__ == "__main__":
    main(sys.argv[1:])
