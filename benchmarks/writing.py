"""The closed-form inverse kinematics along the writing task beside iterative ones. Goal: ×20 at ≤
1e-10 rad (issue of the task).

    python -m benchmarks.writing [--text "RRRID 2004"] [--toolbox]

Ours is all four branches of eq. (A3) for all samples of the task at 1 kHz at once, and the branch
that is followed; then the same with exact joint speeds and accelerations. Theirs is Newton's method
on Pinocchio's Jacobian, each sample started from the one before, down to 1e-12 m, the best case of
an iterative method; --toolbox adds the Robotics Toolbox (Levenberg-Marquardt in C++), which the
paper compared with, if installed. The last row is the general numerical inverse, used where an arm
has no closed form.

Errors are distances from the wanted tip [m], by forward kinematics (A2) in extended precision;
`apart` is the largest difference of a joint's angle between the two ways.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.regressor import rrr
from pipelines.dynamics.rrr_kinematics import BRANCHES, Geometry, inverse, rrr_geometry, tip
from pipelines.io.log import Array
from pipelines.writing.task import writing_task

_TOOLBOX_SAMPLES = 1000  # it takes about as long for one sample as the closed form for all


def newton(model: Any, tips: np.ndarray, start: np.ndarray, behind: Any) -> np.ndarray:
    """Solve by the loop one writes with Pinocchio."""
    model = model.copy()
    frame = model.addFrame(
        pin.Frame("the tip", model.njoints - 1, 0, behind, pin.FrameType.OP_FRAME)
    )
    data, q = model.createData(), start.copy()
    found = np.empty((len(tips), model.nq))
    for k, wanted in enumerate(tips):
        for _ in range(20):
            pin.framesForwardKinematics(model, data, q)
            missed = wanted - data.oMf[frame].translation
            if missed @ missed < 1e-24:
                break
            q = q + np.linalg.solve(
                pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3], missed
            )
        found[k] = q
    return found


def missed(geometry: Geometry, q: np.ndarray, tips: np.ndarray) -> float:
    return float(np.abs(tip(geometry, q.astype(np.longdouble)) - tips).max())


def toolbox(tips: np.ndarray, q: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the Robotics Toolbox on the same arm, each sample from the one before."""
    import roboticstoolbox as rtb
    from spatialmath import SE3

    arm = rtb.DHRobot(
        [
            rtb.RevoluteDH(d=0.56, alpha=np.pi / 2),
            rtb.RevoluteDH(d=0.169, a=0.2),
            rtb.RevoluteDH(d=0.09, a=0.415),
        ]
    )

    def run() -> np.ndarray:
        found, at = np.empty_like(q), q[0]
        for k, wanted in enumerate(tips):
            answer = arm.ikine_LM(
                SE3(wanted), q0=at, mask=[1, 1, 1, 0, 0, 0], tol=1e-24
            )  # half the squared distance
            found[k] = at = answer.q
        return found

    return run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--text", default="RRRID 2004")
    parser.add_argument("--toolbox", action="store_true")
    arguments = parser.parse_args()
    robot, model = rrr()
    geometry, last = rrr_geometry(robot), robot.joints[-1]
    behind = pin.SE3(pin.utils.rotate("x", last.alpha), np.array([last.a, 0.0, last.d]))
    task = writing_task(robot, arguments.text)
    t = np.arange(0.0, task.duration, 1e-3)
    wanted = task.tip(t)
    tips = wanted.position
    branch = BRANCHES.index((1, -1))

    def closed() -> np.ndarray:
        return np.asarray(np.unwrap(inverse(geometry, tips).q[branch], axis=0))

    def motion() -> object:
        return task.motion(t, wanted)

    q = closed()
    def theirs() -> np.ndarray:
        return newton(model, tips, q[0], behind)

    def line(name: str, ours: Callable[[], object], q: Array, peer: Callable[[], Array]) -> str:
        other = peer()
        few = min(len(q), len(other))
        errors = missed(geometry, q, tips[: len(q)]), missed(geometry, other, tips[: len(other)])
        apart = np.abs(q[:few] - other[:few]).max()
        return f"{row(name, race(ours, peer, 5), *errors)}   apart {apart:.1e} rad"

    print(f"'{arguments.text}', {len(t)} samples, {task.duration:.1f} s\n{HEADER}")
    print(line("q, against Newton on Pinocchio", closed, q, theirs), flush=True)
    print(line("q, dq, ddq, against its q alone", motion, q, theirs), flush=True)
    if arguments.toolbox:
        few, few_q = tips[:_TOOLBOX_SAMPLES], q[:_TOOLBOX_SAMPLES]
        name = f"{len(few)} samples, Robotics Toolbox"
        print(line(name, lambda: inverse(geometry, few), few_q, toolbox(few, few_q)))


if __name__ == "__main__":
    main()
