"""Arms of other kinds than the paper's, by their kinematics and limits; links, gains and friction
are drawn.

planar     two joints in an upright plane
scara      two upright axes, a slide, a wrist
six        six axes, the last three through one point
"""

from __future__ import annotations

import math

from pipelines.io.robot import Joint, RobotDescription

_TURN = 0.5 * math.pi


def _joints(*rows: tuple[float, float, float, float, float]) -> tuple[Joint, ...]:
    """From rows of a [m], alpha [rad], d [m], largest speed [rad/s], largest torque [N m]."""
    return tuple(
        Joint(
            f"axis {number}",
            a=a,
            alpha=alpha,
            d=d,
            velocity=velocity,
            acceleration=50.0,
            torque=torque,
            encoder_resolution=1e-5,
        )
        for number, (a, alpha, d, velocity, torque) in enumerate(rows, start=1)
    )


_PLANAR = _joints((0.40, 0.0, 0.0, 6.0, 40.0), (0.30, 0.0, 0.0, 8.0, 15.0))
_SCARA = _joints((0.35, 0.0, 0.20, 5.0, 60.0), (0.25, math.pi, 0.0, 7.0, 30.0))
_SLIDE = Joint(
    "slide",
    type="prismatic",
    position=(0.0, 0.30),
    velocity=0.8,
    acceleration=8.0,
    torque=120.0,
    encoder_resolution=1e-6,
)
_SIX = _joints(
    (0.0, _TURN, 0.35, 4.0, 120.0),
    (0.40, 0.0, 0.0, 4.0, 120.0),
    (0.05, _TURN, 0.0, 5.0, 60.0),
    (0.0, -_TURN, 0.35, 7.0, 20.0),
    (0.0, _TURN, 0.0, 7.0, 20.0),
    (0.0, 0.0, 0.08, 9.0, 10.0),
)
ROBOTS = {
    "planar": RobotDescription("two-joints", (0.0, -9.81, 0.0), "dh", _PLANAR),
    "scara": RobotDescription(
        "scara", (0.0, 0.0, -9.81), "dh", (*_SCARA, _SLIDE, *_joints((0.0, 0.0, 0.10, 9.0, 6.0)))
    ),
    "six": RobotDescription("six-axes", (0.0, 0.0, -9.81), "dh", _SIX),
}
