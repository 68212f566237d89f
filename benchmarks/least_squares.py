"""Regressor and least squares of the RRR arm, 3N × 15, beside Pinocchio's loop with lstsq and
beside FIGAROH.

    python -m benchmarks.least_squares [--samples 10000 100000 1000000] [--memory 10000000]

Goals (performance.md): ×10 at 1e4 and ×15 from 1e5 against Pinocchio, ×30 against FIGAROH up to
1e5; 5 MB of memory beside the samples at 1e7 of them; time grows with their number to the power
1.05 at most.

    ours         equations in blocks, Gram matrices, weighted by channel residuals
    ours, QR     the same blocks into triangular factors, as an ill-conditioned log would have it
    Pinocchio    computeJointTorqueRegressor sample by sample; the 15 columns of a base set, known
                 beforehand, go into one preallocated matrix; np.linalg.lstsq
    FIGAROH      as in its examples, where it is installed: build_regressor_basic,
                 eliminate_non_dynaffect, QRDecomposer.double_decomposition

Torques are Pinocchio's own (`rnea`). Errors are ‖p - p₀‖/‖p₀‖, each in the parameters that the
program itself uses.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import gc
import resource
import subprocess
import sys
import time
import tracemalloc
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import ACTING, RRR
from pipelines.estimation.least_squares import Block, fit, solve, triangulate
from pipelines.io.robot_files import load_robot

_FIGAROH_UP_TO = 100_000  # beyond, its matrices do not fit beside the others'
_TILE = 8192
COLUMNS = tuple(np.array(columns, dtype=np.intp) for columns in ACTING)


@dataclass(frozen=True, eq=False)
class RigidEquations:
    """The equations τ = Y p of a motion in blocks, each overwritten by the next."""

    body: RigidBody
    q: np.ndarray  # [rad] (samples, joints)
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray  # [N m] (samples, joints)
    block: int = 6144  # samples at most: what is worked on then stays in the cache

    def __iter__(self) -> Iterator[Block]:
        count = max(1, -(-len(self.q) // self.block))
        size = -(-len(self.q) // count)
        memory = np.empty((28, size))
        for first in range(0, len(self.q), size):
            part = slice(first, min(first + size, len(self.q)))
            motion = (self.q, self.dq, self.ddq, self.tau)
            q, dq, ddq, tau = (np.asarray(x[part], dtype=np.float64) for x in motion)
            if isinstance(self.body, RRR):
                rows = self.body.acting_rows(q, dq, ddq, memory[:, : len(q)])
                yield Block(15, COLUMNS, rows, tuple(np.ascontiguousarray(tau.T)))
            else:
                yield Block.of(self.body.regressor(q, dq, ddq), tau)


@dataclass(frozen=True, eq=False)
class Task:
    """One recorded motion with its torques, and the three programs' truths."""

    motion: np.ndarray  # (3, samples, joints)
    tau: np.ndarray
    body: RRR
    model: Any
    columns: list[int]  # of Pinocchio's regressor: a base set
    truth: np.ndarray  # its base parameters

    def equations(self) -> RigidEquations:
        return RigidEquations(self.body, *self.motion, self.tau)

    def ours(self) -> np.ndarray:
        return fit(self.equations()).solution.beta

    def ours_by_qr(self) -> np.ndarray:
        return solve(triangulate(self.equations())).beta

    def pinocchio(self) -> np.ndarray:
        import pinocchio as pin

        (q, dq, ddq), columns, model, data = (
            self.motion,
            self.columns,
            self.model,
            self.model.createData(),
        )
        w = np.empty((3 * len(q), len(columns)))
        for k in range(len(q)):
            w[3 * k : 3 * k + 3] = pin.computeJointTorqueRegressor(
                model, data, q[k], dq[k], ddq[k]
            )[:, columns]
        return np.linalg.lstsq(w, self.tau.ravel(), rcond=None)[0]

    def figaroh(self) -> tuple[np.ndarray, np.ndarray]:
        """Its estimate, and the value that its own expressions have for the true links."""
        from figaroh.tools.qrdecomposition import QRDecomposer
        from figaroh.tools.regressor import build_regressor_basic, eliminate_non_dynaffect

        names = dict(
            zip(
                (
                    f"{what}_{i}"
                    for i in range(3)
                    for what in ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
                ),
                _phi(self.model),
                strict=True,
            )
        )
        w = build_regressor_basic(
            _Robot(self.model, self.model.createData()),
            *self.motion,
            {"is_joint_torques": True, "act_idxv": [0, 1, 2]},
        )
        reduced, kept = eliminate_non_dynaffect(w, names)
        _, _, _, phi, nominal = QRDecomposer().double_decomposition(
            self.tau.T.ravel(), reduced, kept, names
        )
        return phi, np.asarray(nominal)


@dataclass(frozen=True)
class _Robot:
    """The part of a robot wrapper that FIGAROH needs."""

    model: Any
    data: Any


def _phi(model: Any) -> np.ndarray:
    return np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])


def task(samples: int) -> Task:
    import pinocchio as pin

    from benchmarks.regressor import rrr

    robot, model = rrr()
    motion = np.random.default_rng(7).uniform(-3.0, 3.0, (3, samples, 3))
    data = model.createData()
    tau = np.empty((samples, 3))
    for k in range(samples):
        tau[k] = pin.rnea(model, data, *motion[:, k])
    few = np.concatenate(
        [pin.computeJointTorqueRegressor(model, data, *motion[:, k]) for k in range(60)]
    )
    columns: list[int] = []
    for k in range(few.shape[1]):
        if np.linalg.matrix_rank(few[:, [*columns, k]], tol=1e-9) == len(columns) + 1:
            columns.append(k)
    truth = np.linalg.lstsq(few[:, columns], few @ _phi(model), rcond=None)[0]
    return Task(motion, tau, RRR(robot), model, columns, truth)


def compare(samples: int, repeats: int) -> list[str]:
    one = task(samples)
    p = one.body.known_parameters()
    assert p is not None
    peer_error = _error(one.pinocchio(), one.truth)
    lines = [
        row(
            f"{samples:.0e}, Pinocchio + lstsq",
            race(one.ours, one.pinocchio, repeats),
            _error(one.ours(), p),
            peer_error,
        ),
        row(
            f"{samples:.0e}, Pinocchio + lstsq, ours by QR",
            race(one.ours_by_qr, one.pinocchio, repeats),
            _error(one.ours_by_qr(), p),
            peer_error,
        ),
    ]
    if find_spec("figaroh") is None:
        lines.append(f"{samples:.0e}, FIGAROH is not installed here: pip install figaroh")
    elif samples <= _FIGAROH_UP_TO:
        theirs = _error(*one.figaroh())
        lines.append(
            row(
                f"{samples:.0e}, FIGAROH",
                race(one.ours, one.figaroh, min(repeats, 3)),
                _error(one.ours(), p),
                theirs,
            )
        )
    return lines


def _error(p: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(p - truth) / np.linalg.norm(truth))


@dataclass(frozen=True, eq=False)
class Endless:
    """A motion of any length without the memory for it: one stretch, over and over."""

    stretch: np.ndarray
    samples: int

    def __len__(self) -> int:
        return self.samples

    def __getitem__(self, part: slice) -> np.ndarray:
        return self.stretch[np.arange(part.start, part.stop) % len(self.stretch)]


def streamed(samples: int) -> tuple[RigidEquations, np.ndarray]:
    body = RRR(load_robot("rrr"))
    p = body.known_parameters()
    assert p is not None
    motion = np.random.default_rng(7).uniform(-3.0, 3.0, (3, _TILE, 3))
    four: list[Any] = [Endless(x, samples) for x in (*motion, body.torque(*motion, p))]
    return RigidEquations(body, *four), p


def memory(samples: int) -> str:
    """Peak memory of a fit beyond what the process held before: by its resident pages, and by
    Python's account.
    """
    warm, _ = streamed(_TILE)
    fit(warm)
    many, p = streamed(samples)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    beta = fit(many).solution.beta
    pages = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0
    tracemalloc.start()
    fit(many)
    peak = tracemalloc.get_traced_memory()[1] / 2**20
    return (
        f"extra memory at {samples:.0e} samples: {peak:.2f} MB allocated, resident +{pages:.2f} MB;"
        f" error {_error(beta, p):.1e}"
    )


def growth(counts: tuple[int, ...] = (10_000, 100_000, 1_000_000)) -> str:
    """Exponent of time over samples, each length measured for about as long, in turn."""
    times: dict[int, list[float]] = {n: [] for n in counts}
    equations = {n: streamed(n)[0] for n in counts}
    for _ in range(7):
        for n, one in equations.items():
            gc.collect()
            start = time.perf_counter()
            for _ in range(max(1, 100_000 // n)):
                fit(one)
            times[n].append((time.perf_counter() - start) / max(1, 100_000 // n))
    slope = np.polyfit(np.log(counts), np.log([np.median(times[n]) for n in counts]), 1)[0]
    return f"time grows with samples to the power {slope:.2f}: " + ", ".join(
        f"{n:.0e} {1e6 * np.median(times[n]) / n:.3f} µs/sample" for n in counts
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--memory", type=int, default=10_000_000)
    parser.add_argument(
        "--memory-alone", action="store_true", help="this process measures memory and nothing else"
    )
    given = parser.parse_args()
    if given.memory_alone:
        print(memory(given.memory))
        return
    warnings.simplefilter("ignore")
    print(HEADER)
    for samples in given.samples:
        print("\n".join(compare(samples, 7 if samples < 1_000_000 else 3)), flush=True)
    print(growth())
    print(
        subprocess.run(
            [
                sys.executable,
                "-m",
                "benchmarks.least_squares",
                "--memory-alone",
                "--memory",
                str(given.memory),
            ],
            capture_output=True,
            text=True,
            check=True,
        ).stdout,
        end="",
    )


if __name__ == "__main__":
    main()
