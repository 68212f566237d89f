"""`rrrid estimate-bps` on one log of 10 s, beside the script one would write: CPU seconds of fresh
processes, in turn.

    python -m benchmarks.whole_command [--repeats 7]

Goals (performance.md): a ratio of 3.5 at least, 750 ms at most; the report is left out. The script
reads the log with h5py, reconstructs each joint with a filterpy loop, builds Pinocchio's regressor
sample by sample, low-passes torque and columns alike with scipy and solves with np.linalg.lstsq. It
prints base parameters, while the command also holds blocks out, gives standard deviations, checks
links, and writes a model and a derived log.

Two scripts run: with filterpy's observer, and with its RTS smoother, which is what the command does
by default.

The answers are compared by the torque they predict for the validation log: the errors are of it,
relative.
"""

from __future__ import annotations

from benchmarks.startup import cpu_seconds  # isort: skip

import argparse
import json
import os
import shutil
import statistics
import sys
import tempfile
from pathlib import Path

SAMPLES = Path(__file__).resolve().parents[1] / "sample_logs/rrr-closed-form"

PEER = """
import json, sys
import h5py, numpy as np, pinocchio as pin
from filterpy.kalman import KalmanFilter
from scipy.signal import butter, sosfiltfilt

log, cutoff, every, out, method = sys.argv[1:]
cutoff, every = float(cutoff), int(every)
with h5py.File(log) as file:
    q, tau = file["signals/q"][:], file["signals/tau"][:]
T, n, t = 1e-3, q.shape[1], np.arange(len(q))
states = np.empty((len(t), n, 3))
for j in range(n):
    f = KalmanFilter(dim_x=3, dim_z=1)
    f.F = np.array([[1, T, T * T / 2], [0, 1, T], [0, 0, 1]])
    g = np.array([T**3 / 6, T**2 / 2, T]) * (290.0 if method == "observer" else 12.0)
    f.H, f.R, f.Q = np.eye(3)[:1], np.array([[1e-10 / 12]]), np.outer(g, g)
    f.x, f.P = np.array([q[0, j], 0.0, 0.0]), np.diag([1e-10, 1e-2, 1.0])
    if method == "smoother":
        means, covariances, _, _ = f.batch_filter(q[:, j], update_first=True)
        states[:, j] = f.rts_smoother(means, covariances)[0]
        continue
    for k in range(len(t)):
        f.update(q[k, j])
        states[k, j] = f.x
        f.predict()
q, dq, ddq = states.transpose(2, 0, 1)
model, parent, place = pin.Model(), 0, pin.SE3.Identity()
model.gravity.linear = np.array([0.0, 0.0, -9.8062])
for j, (a, alpha, d) in enumerate([(0.0, np.pi / 2, 0.56), (0.2, 0.0, 0.169), (0.415, 0.0, 0.09)]):
    parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{j}")
    model.appendBodyToJoint(parent, pin.Inertia.Zero(), pin.SE3.Identity())
    place = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, d]))
data = model.createData()
regressor = pin.computeJointTorqueRegressor
Y = np.array([regressor(model, data, q[k], dq[k], ddq[k]) for k in range(len(t))])
zero = np.zeros((len(t), n, n))
diagonal = np.arange(n)
coulomb, viscous, offset = zero.copy(), zero.copy(), zero.copy()
coulomb[:, diagonal, diagonal] = np.tanh(100 * dq)
viscous[:, diagonal, diagonal] = dq
offset[:, diagonal, diagonal] = 1.0
Y = np.concatenate([Y, coulomb, viscous, offset], axis=2)
centred = tau.copy()
centred[1:] = (tau[1:] + tau[:-1]) / 2
sos = butter(4, cutoff, fs=1 / T, output="sos")
A = sosfiltfilt(sos, Y, axis=0)[200:-200:every].reshape(-1, Y.shape[2])
y = sosfiltfilt(sos, centred, axis=0)[200:-200:every].reshape(-1)
json.dump(np.linalg.lstsq(A, y, rcond=1e-8)[0].tolist(), open(out, "w"))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=7)
    repeats = parser.parse_args().repeats
    rrrid = shutil.which(
        "rrrid", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    )
    if rrrid is None:
        sys.exit("rrrid is not installed in this environment: pip install -e .")
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        # both sides as installed, with their modules' byte code kept; one BLAS thread
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        os.environ |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        os.environ["PYTHONPYCACHEPREFIX"] = str(here / "bytecode")
        log, script = str(SAMPLES / "excitation-1.h5"), here / "peer.py"
        script.write_text(PEER)
        ours = [rrrid, "estimate-bps", log, "--no-report", "--quiet", "--out", str(here / "out")]
        cpu_seconds(ours)
        peers = {
            method: [
                sys.executable,
                str(script),
                log,
                *_conditioning(here / "out"),
                str(here / f"{method}.json"),
                method,
            ]
            for method in ("observer", "smoother")
        }
        for peer in peers.values():
            cpu_seconds(peer)
        runs = [
            (cpu_seconds(ours), *(cpu_seconds(peer) for peer in peers.values()))
            for _ in range(repeats)
        ]
        mine, *theirs = (1e3 * statistics.median(side) for side in zip(*runs, strict=True))
        errors = _errors(here, list(peers))
    print(
        f"rrrid estimate-bps: {mine:.0f} ms CPU, error {errors[0]:.1e}; goals: 750 ms at most, 3.5 "
        "times less than a script"
    )
    for k, method in enumerate(peers):
        ratios = sorted(run[k + 1] / run[0] for run in runs)
        print(
            f"script with filterpy's {method}: {theirs[k]:.0f} ms, error {errors[k + 1]:.1e}, "
            f"ratio {statistics.median(ratios):.1f} ({ratios[0]:.1f}-{ratios[-1]:.1f})"
        )


def _conditioning(out: Path) -> tuple[str, str]:
    """Return the cut-off that the command chose [Hz], and every how many samples it kept."""
    result = json.loads((out / "result.json").read_text())
    return str(result["filter_hz"]), str(int(1e3 / (4 * result["filter_hz"])))


def _errors(folder: Path, methods: list[str]) -> list[float]:
    """‖Y β - τ‖ / ‖τ‖ of the rigid torque along another motion, known exactly: ours, then the
    scripts'.
    """
    import numpy as np
    import pinocchio as pin

    from pipelines.dynamics.arm import Arm
    from pipelines.io.model_file import read_model
    from sample_logs.make_closed_form import from_rest, within_limits
    from sample_logs.make_model import synthetic_arm

    truth = synthetic_arm()
    rng = np.random.default_rng([22, 2])
    motion = within_limits(
        from_rest(rng, np.array([0.0, -np.pi / 2, 1.0]), 0.1, np.ones(3)), truth
    )(np.arange(0.0, 10.0, 0.02))
    tau = truth.body.torque(motion.q, motion.dq, motion.ddq, truth.p)
    ours = Arm.from_model(read_model(folder / "out/model.json"))
    scope: dict[str, object] = {"np": np, "pin": pin}
    building = PEER[PEER.index("model, parent") : PEER.index("Y = np.array")]
    exec(building, scope)
    found = [ours.body.torque(motion.q, motion.dq, motion.ddq, ours.p)]
    for method in methods:
        beta = np.array(json.loads((folder / f"{method}.json").read_text()))[:30]
        found.append(
            np.array(
                [
                    pin.computeJointTorqueRegressor(scope["model"], scope["data"], *state) @ beta
                    for state in zip(motion.q, motion.dq, motion.ddq, strict=True)
                ]
            )
        )
    return [float(np.linalg.norm(torque - tau) / np.linalg.norm(tau)) for torque in found]


if __name__ == "__main__":
    main()
