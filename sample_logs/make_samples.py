"""Make the sample logs and the example model: python -m sample_logs.make_samples [FOLDER…]

Every run gives the same logs, digest by digest; those of the virtual test bench with the same MuJoCo on the same kind of
processor, which takes some minutes. With folders named, only these are made.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

from pipelines.log.experiment import ExperimentLog
from pipelines.log.files import write_log
from sample_logs.make_changed import changed_logs
from sample_logs.make_closed_form import closed_form_logs
from sample_logs.make_healthy import healthy_logs
from sample_logs.make_model import HERE, example_text

__all__ = ["FOLDERS", "MUJOCO", "main"]

MUJOCO = "4.0.0"  # that made the committed logs; another rounds the last bit otherwise
FOLDERS: dict[str, Callable[[], Iterator[tuple[str, ExperimentLog]]]] = {
    "rrr-closed-form": lambda: iter(closed_form_logs().items()), "rrr-healthy": healthy_logs, "rrr-changed": changed_logs}


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


if __name__ == "__main__":
    main(sys.argv[1:])
