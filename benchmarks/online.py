"""The complete model for one sample, as a controller evaluates it, beside Pinocchio. Goal: ≤ 20 µs
a sample in plain Python.

    python -m benchmarks.online [--samples 2000]

Ours gives friction, inertial, Coriolis and gravity torque. Theirs is what one writes for the same
four parts: three calls of Pinocchio's compiled rnea, and the friction law with NumPy. The second
row of each arm is `Arm.torque_parts` on one row, which is made for many samples. Errors are
relative to the largest torque: ours against the arrays of `Arm`, theirs against the same.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.regressor import rrr, tx40
from pipelines.model.arm import Acting, Arm
from pipelines.model.effects.three_sigmoid import ThreeSigmoid
from pipelines.model.online import OnlineModel
from pipelines.model.rigid.body import Motion

_LAW = {"f1": 1.5, "f2": 4.8, "f3": -1.5, "w1": 120.0, "w2": 60.0, "w3": 12.0, "b": 0.6}
_HEIGHTS, _SHARPNESSES = np.array([1.5, 4.8, -1.5]), np.array([120.0, 60.0, 12.0])


def with_pinocchio(
    model: Any,
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, ...]]:
    data, still = model.createData(), np.zeros(model.nv)

    def parts(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, ...]:
        gravity = pin.rnea(model, data, q, still, still).copy()
        coriolis = pin.rnea(model, data, q, dq, still) - gravity
        inertia = pin.rnea(model, data, q, still, ddq) - gravity
        return np.tanh(np.outer(dq, _SHARPNESSES)) @ _HEIGHTS + 0.6 * dq, inertia, coriolis, gravity

    return parts


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=2000)
    samples = parser.parse_args().samples
    print(
        f"{samples} samples, one after another; a time divided by that is the time of one\n{HEADER}"
    )
    for name, (robot, model) in (("RRR", rrr()), ("TX40", tx40())):
        rigid = Arm.from_links(robot)
        arm = Arm(
            name,
            rigid.body,
            rigid.base,
            tuple(Acting.of(ThreeSigmoid(j + 1), _LAW) for j in range(robot.n_joints)),
        )
        online, peer = OnlineModel(arm), with_pinocchio(model)
        q, dq, ddq = np.random.default_rng(1).uniform(-3.0, 3.0, (3, samples, robot.n_joints))
        rows, lists = (
            list(zip(q, dq, ddq, strict=True)),
            list(zip(q.tolist(), dq.tolist(), ddq.tolist(), strict=True)),
        )
        whole = arm.torque_parts(Motion(np.arange(float(samples)), q, dq, ddq))
        exact = np.array([whole.friction, whole.inertia, whole.coriolis, whole.gravity])

        def ours(online: OnlineModel = online, lists: list[Any] = lists) -> list[Any]:
            return [online.parts(*one) for one in lists]

        def theirs(peer: Callable[..., Any] = peer, rows: list[Any] = rows) -> list[Any]:
            return [peer(*one) for one in rows]

        def arrays(arm: Arm = arm, rows: list[Any] = rows) -> list[Any]:
            return [
                arm.torque_parts(Motion(np.zeros(1), a[None], b[None], c[None])) for a, b, c in rows
            ]

        errors = [
            float(np.abs(np.array(found).transpose(1, 0, 2) - exact).max() / np.abs(exact).max())
            for found in (ours(), theirs())
        ]
        for label, other, error in (
            ("Pinocchio, three rnea", theirs, errors[1]),
            ("Arm.torque_parts, one row", arrays, 0.0),
        ):
            result = race(ours, other)
            print(
                f"{row(f'{name}, against {label}', result, errors[0], error)}   "
                f"{result.ours_s / samples * 1e6:.1f} µs a sample",
                flush=True,
            )


if __name__ == "__main__":
    main()
