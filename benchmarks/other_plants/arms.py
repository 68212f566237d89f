"""Arms of one to six axes as plain numbers, as a robot description and as a MuJoCo model.

arm = ARMS["gantry"].varied(rng)
arm.described(resolution, geared=True)      its description in a log
arm.model(step)                             what moves, compiled by MuJoCo
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from pipelines.io.log import Array
from pipelines.io.robot import Drive, Joint, RobotDescription

Vector = tuple[float, float, float]
_TURN = 0.5 * math.pi
_UP: Vector = (0.0, 0.0, 1.0)
_LIMIT = '<limit lower="-9" upper="9" effort="1000" velocity="9"/>'  # a URDF's slide must have one


@dataclass(frozen=True)
class Axis:
    """A joint with the link behind it: modified DH row, or any axis in a frame that is shifted
    only.
    """

    a: float  # [m] modified DH: a and alpha come before d
    alpha: float  # [rad]
    d: float  # [m]
    mass: float  # [kg]
    com: Vector  # [m] in the joint's frame
    gyration: float  # [m] radius about the centre of mass, in every direction alike to a fifth
    rotor: float  # [kg m^2] or [kg] at joint side: gear ratio squared times the rotor's own
    speed: float  # [rad/s] or [m/s] largest
    reach: float  # [rad] or [m] to either side of home
    home: float = 0.0
    slide: bool = False
    along: Vector = _UP
    gear: float = 100.0

    @property
    def place(self) -> Vector:
        """Origin of the joint's frame in that of the joint before it [m]."""
        return self.a, -math.sin(self.alpha) * self.d, math.cos(self.alpha) * self.d


@dataclass(frozen=True)
class Arm:
    """Axes one on the other."""

    name: str
    axes: tuple[Axis, ...]
    gravity: Vector = (0.0, 0.0, -9.81)

    def varied(self, rng: np.random.Generator) -> Arm:
        """Another of its kind: masses, centres and rotors drawn again within a fifth."""

        def other(axis: Axis) -> Axis:
            by = rng.uniform(0.8, 1.2, 6)
            com = tuple(
                float(x * f + 0.01 * (f - 1.0)) for x, f in zip(axis.com, by[:3], strict=True)
            )
            return replace(
                axis,
                mass=axis.mass * by[3],
                com=com,
                gyration=axis.gyration * by[4],
                rotor=axis.rotor * by[5],
            )

        return replace(self, axes=tuple(map(other, self.axes)))

    def described(
        self, resolution: tuple[float, ...], torque: Array, geared: bool
    ) -> RobotDescription:
        """Kinematics and limits; links are not known. Modified DH where every joint is about z,
        else a URDF.
        """
        plain = all(axis.along == _UP for axis in self.axes)
        joints = tuple(
            Joint(
                f"axis {k}",
                "prismatic" if axis.slide else "revolute",
                *((axis.a, axis.alpha, axis.d) if plain else (0.0, 0.0, 0.0)),
                velocity=axis.speed,
                acceleration=60.0 * axis.speed,
                torque=float(rated),
                encoder_resolution=step,
            )
            for k, (axis, step, rated) in enumerate(
                zip(self.axes, resolution, torque, strict=True), start=1
            )
        )
        ratios = tuple(
            tuple(np.where(np.arange(len(self.axes)) == k, axis.gear, 0.0).tolist())
            for k, axis in enumerate(self.axes)
        )
        return RobotDescription(
            self.name,
            self.gravity,
            "mdh" if plain else "urdf",
            joints,
            urdf_text=None if plain else self._urdf(),
            tip_link=None if plain else f"link {len(joints)}",
            drive=Drive(ratios) if geared else None,
        )

    def _urdf(self) -> str:
        text = ['<robot name="other"><link name="link 0"/>']
        for k, axis in enumerate(self.axes, start=1):
            place, along = (" ".join(map(repr, x)) for x in (axis.place, axis.along))
            kind = "prismatic" if axis.slide else "continuous"
            text.append(
                f'<link name="link {k}"/><joint name="axis {k}" type="{kind}">'
                f'<parent link="link {k - 1}"/><child link="link {k}"/>'
                f'<origin xyz="{place}" rpy="{axis.alpha!r} 0 0"/>'
                f'<axis xyz="{along}"/>{_LIMIT if axis.slide else ""}</joint>'
            )
        return "".join([*text, "</robot>"])

    def model(
        self, step: float, gravity: Vector | None = None, scale: float = 1.0, payload: float = 0.0
    ) -> Any:
        """Return the arm in MuJoCo, Runge-Kutta 4 with steps of `step` [s]; links `scale` times as
        heavy, `payload` [kg] at the last.
        """
        spec = self.spec(gravity, scale, payload)
        spec.option.timestep = step
        return spec.compile()

    def spec(self, gravity: Vector | None = None, scale: float = 1.0, payload: float = 0.0) -> Any:
        """Return the same before it is compiled."""
        spec = mujoco.MjSpec()
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        spec.option.gravity = self.gravity if gravity is None else gravity
        spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
            mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        )
        body = spec.worldbody
        for axis in self.axes:
            about = scale * axis.mass * axis.gyration**2
            half = 0.5 * axis.alpha
            body = body.add_body(
                pos=axis.place,
                quat=(math.cos(half), math.sin(half), 0.0, 0.0),
                mass=scale * axis.mass,
                ipos=axis.com,
                inertia=(about, 0.9 * about, 0.8 * about),
                explicitinertial=True,
            )
            kind = mujoco.mjtJoint.mjJNT_SLIDE if axis.slide else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(type=kind, axis=axis.along, armature=axis.rotor)
        if payload:
            body.add_body(
                pos=tuple(2.0 * x for x in self.axes[-1].com),
                mass=payload,
                inertia=(1e-4, 1e-4, 1e-4),
                explicitinertial=True,
            )
        return spec


_SHOULDER = Axis(0.0, _TURN, 0.0, 7.0, (0.18, 0.01, 0.02), 0.12, 0.8, 2.5, 0.9, home=0.7)
_WAIST = Axis(0.0, 0.0, 0.40, 9.0, (0.02, 0.01, -0.08), 0.12, 0.8, 2.5, 1.3)
_ELBOW = Axis(0.42, 0.0, 0.0, 4.0, (0.16, 0.0, 0.03), 0.10, 0.3, 3.5, 1.2, home=-1.0)
ARMS = {
    arm.name: arm
    for arm in (
        Arm(
            "pendulum",
            (
                Axis(
                    0.0,
                    _TURN,
                    0.0,
                    3.0,
                    (0.25, 0.02, 0.0),
                    0.08,
                    0.05,
                    5.0,
                    1.8,
                    home=-0.6,
                    gear=30.0,
                ),
            ),
        ),
        Arm(
            "lift",
            (
                Axis(
                    0.0, 0.0, 0.2, 6.0, (0.0, 0.0, 0.05), 0.1, 2.0, 0.8, 0.2, slide=True, gear=300.0
                ),
            ),
        ),
        Arm(
            "table",
            (
                Axis(0.0, 0.0, 0.2, 6.0, (0.03, 0.02, 0.0), 0.15, 0.05, 4.0, 1.6, gear=20.0),
                Axis(
                    0.10,
                    _TURN,
                    0.0,
                    1.5,
                    (0.20, 0.0, 0.02),
                    0.08,
                    0.01,
                    6.0,
                    1.5,
                    home=-1.2,
                    gear=10.0,
                ),
            ),
        ),
        Arm("planar", (replace(_SHOULDER, alpha=_TURN), replace(_ELBOW, a=0.35))),
        Arm("upright", (_WAIST, _SHOULDER, _ELBOW)),
        Arm(
            "scara",
            (
                Axis(0.0, 0.0, 0.3, 8.0, (0.18, 0.0, 0.0), 0.12, 0.6, 3.0, 1.3),
                Axis(0.35, 0.0, 0.0, 4.0, (0.14, 0.01, 0.0), 0.10, 0.3, 4.0, 1.5, home=0.6),
                Axis(
                    0.25,
                    2.0 * _TURN,
                    0.0,
                    2.0,
                    (0.0, 0.0, 0.1),
                    0.08,
                    3.0,
                    0.7,
                    0.12,
                    home=0.1,
                    slide=True,
                    gear=250.0,
                ),
                Axis(0.0, 0.0, 0.1, 0.8, (0.03, 0.01, 0.04), 0.05, 0.02, 7.0, 2.5, gear=50.0),
            ),
        ),
        Arm(
            "gantry",
            (
                Axis(
                    0.0,
                    0.0,
                    0.5,
                    20.0,
                    (0.1, 0.0, 0.0),
                    0.3,
                    8.0,
                    1.0,
                    0.35,
                    slide=True,
                    along=(1.0, 0.0, 0.0),
                    gear=120.0,
                ),
                Axis(
                    0.0,
                    0.0,
                    0.1,
                    10.0,
                    (0.0, 0.1, 0.0),
                    0.2,
                    5.0,
                    1.0,
                    0.30,
                    slide=True,
                    along=(0.0, 1.0, 0.0),
                    gear=120.0,
                ),
                Axis(
                    0.0,
                    0.0,
                    0.0,
                    4.0,
                    (0.0, 0.0, -0.1),
                    0.1,
                    3.0,
                    0.7,
                    0.15,
                    slide=True,
                    gear=200.0,
                ),
            ),
        ),
        Arm(
            "wrist",
            (
                Axis(0.0, 0.0, 0.1, 2.0, (0.03, 0.01, 0.02), 0.06, 0.03, 6.0, 2.0, gear=50.0),
                Axis(
                    0.0,
                    _TURN,
                    0.0,
                    1.2,
                    (0.05, 0.02, 0.01),
                    0.05,
                    0.02,
                    6.0,
                    1.2,
                    home=0.5,
                    gear=50.0,
                ),
                Axis(0.0, -_TURN, 0.1, 0.8, (0.03, 0.02, 0.08), 0.05, 0.02, 8.0, 2.5, gear=50.0),
            ),
        ),
        Arm(
            "six",
            (
                _WAIST,
                replace(_SHOULDER, a=0.05),
                _ELBOW,
                Axis(0.03, _TURN, 0.35, 1.5, (0.01, 0.02, -0.05), 0.06, 0.05, 5.0, 1.8, gear=80.0),
                Axis(
                    0.0,
                    -_TURN,
                    0.0,
                    1.0,
                    (0.02, 0.03, 0.01),
                    0.05,
                    0.04,
                    5.0,
                    1.4,
                    home=0.8,
                    gear=80.0,
                ),
                Axis(0.0, _TURN, 0.08, 0.5, (0.03, 0.01, 0.04), 0.04, 0.03, 7.0, 2.4, gear=60.0),
            ),
        ),
    )
}
