"""Read 6 of 20 channels of a log, against fancy selection on one chunked matrix, the usual way to
store a recording.

    python -m benchmarks.reading [SAMPLES]

The matrix is stored with the same filters; where its columns stand and how it is chunked decides
what a selection costs, so three common ways are timed.
"""

from __future__ import annotations

from benchmarks import side_by_side  # isort: skip

import sys
import tempfile
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from pipelines.io import schema
from pipelines.io.files import open_log, write_log
from pipelines.io.hdf5 import read_parts
from pipelines.io.log import ExperimentLog, Signal

ROBOT = Path(__file__).parents[1] / "sample_logs/robots/rrr.toml"
NAMES = ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "temperature")


def make_log(samples: int) -> ExperimentLog:
    """Return a recording of 19 channels whose samples compress as an encoder's do."""
    rng = np.random.default_rng(0)
    t = 1e-3 * np.arange(samples)
    motion = np.round(np.sin(t[:, None] * [1.0, 1.7, 2.3]) / 1e-5) * 1e-5
    values = {name: motion + 1e-3 * i for i, name in enumerate(NAMES)}
    values["tau"] = np.round((motion + rng.normal(scale=0.02, size=motion.shape)) / 0.03) * 0.03
    signals = {
        name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1])
        for name, x in ({"t": t} | values).items()
    }
    return ExperimentLog(
        "reading",
        "excitation",
        "identify",
        "simulated",
        "rrr-tue",
        1e-3,
        ROBOT.read_text(),
        signals,
    )


def write_matrix(
    path: Path, log: ExperimentLog, order: list[int], chunks: bool | tuple[int, int]
) -> None:
    """Write the same channels, and one more, as one (samples, 20) matrix: the same filters, the
    columns in the given order.
    """
    columns = np.hstack(
        [
            *(s.values.reshape(len(log.t), -1) for s in log.signals.values()),
            np.zeros((len(log.t), 1)),
        ]
    )
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "data",
            data=columns[:, order],
            chunks=chunks,
            compression="gzip",
            compression_opts=1,
            shuffle=True,
            fletcher32=True,
        )


def main(samples: int) -> None:
    log = make_log(samples)
    wanted = np.hstack([log.q, log.tau])
    # Recorders write joint by joint (q1, tau1, ...) more often than signal by signal; the named
    # peer is the first.
    joint_by_joint = [0, *(1 + 3 * signal + joint for joint in range(3) for signal in range(6)), 19]
    peers = (
        ("joint by joint, chunks of h5py", joint_by_joint, True),
        ("joint by joint, chunks of (4096, 20)", joint_by_joint, (4096, 20)),
        ("signal by signal, chunks of h5py", list(range(20)), True),
    )
    with tempfile.TemporaryDirectory() as folder:
        ours, peer = Path(folder) / "log.h5", Path(folder) / "matrix.h5"
        write_log(ours, log)
        print(
            f"{samples:.0e} samples, q and tau of 20 channels; ours: the layout alone, then "
            "open_log (hashed, guarded, checked)"
        )
        print(side_by_side.HEADER)
        for words, order, chunks in peers:
            write_matrix(peer, log, order, chunks)
            chosen = [order.index(column) for column in range(1, 7)]
            by_place = np.argsort(chosen)

            def fancy(columns: list[int]) -> np.ndarray:
                with h5py.File(peer) as file:
                    return file["data"][:, columns]

            select = partial(fancy, sorted(chosen))

            peer_error = float(np.abs(select() - wanted[:, by_place]).max())
            for read in (
                lambda: read_parts(ours, ("t", "q", "tau")),
                lambda: open_log(ours, only=()).log,
            ):
                found = read()
                error = float(np.abs(np.hstack([found.q, found.tau]) - wanted).max())
                print(
                    side_by_side.row(
                        words, side_by_side.race(read, select, repeats=5), error, peer_error
                    )
                )


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000)
