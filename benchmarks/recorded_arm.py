"""Simulate motions of serial arms, with torques by Pinocchio, to be written as recordings (see
import_layouts).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Arm:
    """A serial arm whose links lie along x; `axes` are x, y, z for hinges and X, Y, Z for
    sliders."""

    name: str
    joints: tuple[str, ...]
    axes: str
    effort: tuple[float, ...]  # N m or N
    fingers: tuple[str, ...] = ()  # further joints of the URDF, at the last link
    continuous: bool = False

    def urdf(self) -> str:
        """Return the description as URDF text."""
        parts = [f'<robot name="{self.name}"><link name="link_0"/>']
        for j, (name, axis) in enumerate(zip(self.joints, self.axes, strict=True)):
            kind = (
                "prismatic" if axis.isupper() else "continuous" if self.continuous else "revolute"
            )
            limit = (
                'lower="0.0" upper="0.4" velocity="1"'
                if axis.isupper()
                else 'lower="-3.1" upper="3.1" velocity="3.2"'
            )
            parts.append(_link(f"link_{j + 1}", 6.0 / (j + 1.5)))
            parts.append(
                _joint(
                    name,
                    kind,
                    j,
                    j + 1,
                    axis,
                    0.0 if j == 0 else 0.3,
                    f'{limit} effort="{self.effort[j]}"',
                )
            )
        n = len(self.joints)
        for k, name in enumerate(self.fingers):
            parts.append(_link(f"link_{n + 1 + k}", 0.05))
            parts.append(
                _joint(
                    name,
                    "prismatic",
                    n,
                    n + 1 + k,
                    "Y",
                    0.1,
                    'lower="0" upper="0.04" velocity="0.2" effort="20"',
                )
            )
        return "\n".join([*parts, "</robot>"])

    def toml(self) -> str:
        """Return the description as a robot file of this project, modified DH where axes are z
        and y only."""
        text = [
            f'name = "{self.name}"',
            "gravity = [0.0, 0.0, -9.81]",
            '[kinematics]\nconvention = "dh"',
        ]
        for j, (name, axis) in enumerate(zip(self.joints, self.axes, strict=True)):
            slides = axis.isupper()
            values = {
                "name": f'"{name}"',
                "type": '"prismatic"' if slides else '"revolute"',
                "a": 0.0 if j == 0 else 0.3,
                "alpha": 1.5707963 if j == 0 and axis == "z" else 0.0,
                "d": 0.0,
                "offset": 0.0,
                "position": [0.0, 0.4] if slides else [-3.1, 3.1],
                "velocity": 1.0 if slides else 3.2,
                "torque": self.effort[j],
            }
            text += ["[[joint]]", *(f"{key} = {value}" for key, value in values.items())]
        return "\n".join(text) + "\n"


def _link(name: str, mass: float) -> str:
    inertia = " ".join(
        f'{k}="{mass * f}"' for k, f in (("ixx", 0.002), ("iyy", 0.01), ("izz", 0.01))
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="0.12 0.01 0.02"/><mass value="{mass}"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: int, child: int, axis: str, x: float, limit: str) -> str:
    direction = " ".join("1" if axis.lower() == a else "0" for a in "xyz")
    return (
        f'<joint name="{name}" type="{kind}">'
        f'<parent link="link_{parent}"/><child link="link_{child}"/>'
        f'<origin xyz="{x} 0 0.1"/><axis xyz="{direction}"/><limit {limit}/></joint>'
    )


@dataclass(frozen=True)
class Run:
    """One motion of an arm: SI, (N,) or (N, n)."""

    arm: Arm
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    q_ref: np.ndarray  # the reference, 20 ms ahead
    dq_ref: np.ndarray
    tau_ref: np.ndarray  # the commanded torque
    tau_model: np.ndarray  # without friction
    current: np.ndarray  # motor current
    temperature: np.ndarray  # degC
    tau_ext: np.ndarray  # estimate of the external torque: noise
    pose: np.ndarray  # (N, 6), m and rad

    @property
    def n(self) -> int:
        return self.q.shape[1]


def from_point_to_point(
    t: np.ndarray, rng: np.random.Generator, n: int, in_turn: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity, acceleration of moves by quintics of 1.1 s with rests of 0.4 s,
    of all joints together or of one after the other."""
    targets = np.vstack([np.zeros(n), rng.uniform(-1, 1, (int(t[-1] / 1.5) + 2, n))])
    if in_turn:
        moving = np.arange(len(targets))[:, None] % n == np.arange(n)
        targets = np.cumsum(np.where(moving, np.sign(targets) * (0.3 + abs(targets)), 0.0), axis=0)
    k = np.floor(t / 1.5).astype(int)
    s = np.clip((t - 1.5 * k) / 1.1, 0.0, 1.0)[:, None]
    start, step = targets[k], targets[k + 1] - targets[k]
    return (
        start + step * s**3 * (10 - 15 * s + 6 * s**2),
        step * 30 * s**2 * (1 - s) ** 2 / 1.1,
        step * 60 * s * (1 - s) * (1 - 2 * s) / 1.1**2,
    )


def simulate(
    arm: Arm,
    seed: int,
    rate: float = 200.0,
    seconds: float = 12.0,
    how: str = "series",
    size: float = 1.0,
) -> Run:
    """Move the arm along a Fourier series, from point to point ("points") or joint by joint
    ("turns"); Pinocchio's inverse dynamics and friction make its torque."""
    import pinocchio

    model = pinocchio.buildModelFromXML(Arm(arm.name, arm.joints, arm.axes, arm.effort).urdf())
    data, n = model.createData(), len(arm.joints)
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    slides = np.array([a.isupper() for a in arm.axes])
    reach, centre = np.where(slides, 0.15, 1.1), np.where(slides, 0.2, rng.uniform(-0.4, 0.4, n))
    w = 2 * np.pi * np.arange(1, 6) / 8.0
    a, b = rng.normal(size=(2, 5, n)) / np.arange(1, 6)[:, None] ** 0.5

    def series(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if how != "series":
            return from_point_to_point(at, np.random.default_rng(seed), n, how == "turns")
        c, s = np.cos(np.outer(at, w)), np.sin(np.outer(at, w))
        return c @ a + s @ b, (c * w) @ b - (s * w) @ a, -(c * w**2) @ a - (s * w**2) @ b

    scale = size * reach / abs(series(t)[0]).max(axis=0)
    q, dq, ddq = (x * scale for x in series(t))
    centre = size * centre
    q, ahead, dq_ahead = (
        q + centre,
        series(t + 0.02)[0] * scale + centre,
        series(t + 0.02)[1] * scale,
    )
    rigid = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
    effort = abs(rigid).max(axis=0) + 0.5
    tau = rigid + 0.08 * effort * np.tanh(dq / 0.02) + 0.05 * effort * dq / abs(dq).max(axis=0)
    tau_measured = tau + 0.003 * effort * rng.normal(size=tau.shape)
    return Run(
        arm,
        t,
        q + 1e-5 * rng.normal(size=q.shape),
        dq + 2e-3 * reach * rng.normal(size=q.shape),
        ddq,
        tau_measured,
        ahead,
        dq_ahead,
        tau + 0.02 * effort * rng.normal(size=tau.shape),
        rigid,
        tau_measured / np.linspace(11.0, 5.0, n),
        31.0 + np.arange(n) + 0.2 * t[:, None] + 0.05 * rng.normal(size=q.shape),
        0.01 * effort * rng.normal(size=tau.shape),
        np.column_stack([np.sin(0.5 * t + k) * 0.4 for k in range(6)]),
    )


UR = Arm(
    "ur5",
    (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ),
    "zyyyzy",
    (150, 150, 150, 28, 28, 28),
)
SIX = Arm("m0609", tuple(f"joint_{j}" for j in range(1, 7)), "zyyxyx", (194, 163, 163, 50, 50, 50))
PANDA = Arm(
    "panda",
    tuple(f"panda_joint{j}" for j in range(1, 8)),
    "zyzyzyz",
    (150,) * 4 + (30,) * 3,
    ("panda_finger_joint1", "panda_finger_joint2"),
)
IIWA = Arm(
    "iiwa7",
    tuple(f"lbr_iiwa_joint_{j}" for j in range(1, 8)),
    "zyzyzyz",
    (176,) * 3 + (110,) * 2 + (40,) * 2,
)
GEN3 = Arm(
    "gen3",
    tuple(f"joint_{j}" for j in range(1, 8)),
    "zyzyzyz",
    (150,) * 4 + (30,) * 3,
    continuous=True,
)
LEFT = Arm(
    "baxter_left",
    tuple(f"left_{j}" for j in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")),
    "zyxyxyx",
    (150,) * 4 + (30,) * 3,
)
THREE = Arm("rrr", ("waist", "shoulder", "elbow"), "zyy", (120, 120, 40))
TWO = Arm("double-pendulum", ("q1", "q2"), "yy", (60, 20))
FOUR = Arm("open_manipulator", ("joint1", "joint2", "joint3", "joint4"), "zyyy", (80, 80, 40, 20))
SCARA = Arm("scara", ("J1", "J2", "J3", "J4"), "zzZz", (90, 60, 200, 20))
ARM7 = tuple(f"arm7_joint{j}" for j in range(1, 8))
SEVEN = Arm("arm7", ARM7, "zyzyzyz", (80, 80, 60, 60, 12, 12, 10))
LEG = Arm("leg2", ("hip", "knee"), "yy", (60, 40))
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
SO100 = Arm("so100", JOINTS, "zyyyx", (60, 60, 40, 20, 10))
LIFT = Arm("lift", ("lift_joint", "joint_1", "joint_2", "joint_3"), "Zyyx", (400, 90, 60, 20))
ELEVEN = Arm("snake", tuple(f"joint_{j}" for j in range(1, 12)), "zyzyzyzyzyz", (90,) * 11)
