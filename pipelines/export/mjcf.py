"""Write an MJCF model for MuJoCo, and load it again.

Source   mujoco.readthedocs.io, XML reference: body/joint, actuator/general

Where the installed MuJoCo reads them, damping and stiffness are polynomials of three terms, which
an older one refuses; the card says which MuJoCo a file needs:

    damping   a v + b v |v| + c v^3            stiffness   k x + l x^2 + m x^3,  x = q - springref

Every joint has a drive whose control is the logged torque: force = gain * ctrl - offset, clipped
and lagging where the model says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.kinematics import Placement
from pipelines.export.config import EXPORT
from pipelines.export.target import ExportJoint, Held, JointTerms, Loaded, Target
from pipelines.export.urdf import numbers, text_of
from pipelines.simulation.replay import Windows

__all__ = ["mjcf"]

_HELD = ("viscous", "rotor_inertia", "torque_offset", "torque_gain", "drive_lag")


def mjcf() -> Target:
    """Return the target, with the terms that the installed MuJoCo has."""
    polynomials = False
    if find_spec("mujoco") is not None:
        import mujoco

        polynomials = hasattr(mujoco, "mjNPOLY")
    forward = ("torque_saturation", "drive_lag")
    columns = 4 if polynomials else 2
    carry = partial(_carry, polynomials=polynomials)
    return Target(
        carry,
        _write,
        _load,
        "mujoco",
        columns=columns,
        forward_only=forward,
        simulate=_simulate,
        reader=_reader,
    )


def _carry(acting: Acting, polynomials: bool) -> Acting | None:
    """Return a cause as MJCF has it: of a spring three powers, without an end to them."""
    name, values = acting.effect.name, acting.values
    if name == "torque_saturation":
        return acting if values["coefficient"] == 1.0 else None
    if name != "spring" or not polynomials:
        return acting if name in _HELD or (name == "quadratic_drag" and polynomials) else None
    straight = ("stiffness", "rest_angle")
    held = {key: values[key] for key in (*straight, "curvature", "hardening")}
    bent = any(x for key, x in values.items() if key not in (*straight, "seen_from", "seen_to"))
    cubic = Acting.of(acting.effect, {"fourth": 0.0, "fifth": 0.0, **held})
    return cubic if bent and cubic.values != values else acting


def _write(held: Held) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the text of an MJCF model, and what it cannot hold of the body."""
    root = Element("mujoco", model=held.name)
    SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = {"gravity": numbers(held.gravity), "timestep": "0.001", "integrator": "implicitfast"}
    SubElement(root, "option", option)
    body = SubElement(SubElement(root, "worldbody"), "body", name=held.root)
    drives = SubElement(root, "actuator")
    for joint, terms in zip(held.joints, held.terms, strict=True):
        body = _body(body, joint, terms)
        _drive(drives, joint, terms)
    SubElement(body, "site", {"name": held.tip, **_place(held.tool)})
    notes = [
        f"MuJoCo has no limit of speed: that of '{joint.name}', {joint.velocity:.4g}, is left out"
        for joint in held.joints
        if math.isfinite(joint.velocity)
    ]
    return {f"{held.name}.xml": text_of(root)}, tuple(notes)


def _reader(held: Held) -> str:
    """Return the oldest MuJoCo that reads the file."""
    values = (values for terms in held.terms for values in (terms.damping, terms.stiffness))
    polynomial = any(any(higher) for _, *higher in values)
    return f"MuJoCo {EXPORT.mujoco_polynomials if polynomial else EXPORT.mujoco} or later"


def _place(placement: Placement) -> dict[str, str]:
    """Return position and quaternion, its real part first."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(placement.rotation).as_quat()
    return {"pos": numbers(placement.position), "quat": numbers((w, x, y, z))}


def _body(parent: Element, joint: ExportJoint, terms: JointTerms) -> Element:
    body = SubElement(parent, "body", {"name": joint.link, **_place(joint.origin)})
    mass, center, tensor = joint.inertial()
    moments, axes = np.linalg.eigh(tensor)  # MuJoCo would find principal axes to 1e-12 only
    place = _place(Placement(axes * np.sign(np.linalg.det(axes)), center))
    SubElement(body, "inertial", {**place, "mass": repr(mass), "diaginertia": numbers(moments)})
    words = {"name": joint.name, "type": "hinge" if joint.revolute else "slide"}
    words["axis"] = numbers(joint.axis)
    if any(map(math.isfinite, joint.position)):
        words["range"] = numbers(np.clip(joint.position, -EXPORT.unlimited, EXPORT.unlimited))
    for key, value in (
        ("armature", terms.rotor),
        ("frictionloss", terms.friction),
        ("springref", terms.rest),
    ):
        words |= {key: repr(value)} if value else {}
    if terms.friction:
        words["solreffriction"] = f"{EXPORT.friction_time} 1"
        words["solimpfriction"] = "0.99 0.999 0.001"
    for key, values in (("damping", terms.damping), ("stiffness", terms.stiffness)):
        words |= {key: numbers(values if any(values[1:]) else values[:1])} if any(values) else {}
    SubElement(body, "joint", words)
    return body


def _drive(drives: Element, joint: ExportJoint, terms: JointTerms) -> None:
    """Add an actuator: its control is the logged torque."""
    words = {"name": f"{joint.name}_drive", "joint": joint.name, "gainprm": repr(terms.gain)}
    words |= {"biastype": "affine", "biasprm": numbers((-terms.offset, 0.0, 0.0))}
    limit = min(joint.torque, terms.limit)
    if math.isfinite(limit):
        words["ctrlrange"] = numbers((-limit, limit))
    if terms.lag:
        words |= {"dyntype": "filterexact", "dynprm": repr(terms.lag)}
    SubElement(drives, "general", words)


def _load(texts: Mapping[str, str], held: Held, motion: Motion) -> Loaded | None:
    """Return inverse dynamics by MuJoCo: the control that the drives need.

    MuJoCo's dry friction is a constraint that looks one step ahead; while a joint slides it is
    frictionloss times the sign of its speed, which is added here.
    """
    if find_spec("mujoco") is None:
        return None
    import mujoco

    model, data, positions, speeds, drives = _opened(texts, held)
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_FRICTIONLOSS) | int(off.mjDSBL_LIMIT)
    tau = np.zeros(motion.q.shape)
    for row, (q, v, a) in enumerate(zip(motion.q, motion.dq, motion.ddq, strict=True)):
        data.qpos[positions], data.qvel[speeds], data.qacc[speeds] = q, v, a
        mujoco.mj_inverse(model, data)
        tau[row] = data.qfrc_inverse[speeds]
    tau += model.dof_frictionloss[speeds] * np.sign(motion.dq)
    tau = (tau - model.actuator_biasprm[drives, 0]) / model.actuator_gainprm[drives, 0]
    return Loaded(f"MuJoCo {mujoco.__version__}", tau)


def _simulate(
    texts: Mapping[str, str], held: Held, motion: Motion, tau: Array, windows: Windows
) -> Array | None:
    """Return positions by MuJoCo's own integrator in the windows of a log, NaN elsewhere.

    Each window starts at the state of the log; the drives get its torque.
    """
    if find_spec("mujoco") is None:
        return None
    import mujoco

    model, data, positions, speeds, drives = _opened(texts, held)
    model.opt.timestep, q = motion.sample_time, np.full_like(motion.q, np.nan)
    for first in windows.first:
        mujoco.mj_resetData(model, data)
        data.qpos[positions], data.qvel[speeds] = motion.q[first], motion.dq[first]
        for j, drive in enumerate(drives):
            if model.actuator_actadr[drive] >= 0:  # a lagging drive has settled
                data.act[model.actuator_actadr[drive]] = tau[first, j]
        for k in range(first, first + windows.length):
            q[k] = data.qpos[positions]
            data.ctrl[drives] = tau[k]
            mujoco.mj_step(model, data)
    return q


def _opened(texts: Mapping[str, str], held: Held) -> tuple[Any, ...]:
    """Return model and data, and the places of positions, speeds and drives, joint by joint."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(*texts.values())
    joints = [model.joint(joint.name) for joint in held.joints]
    positions, speeds = ([int(getattr(j, k)[0]) for j in joints] for k in ("qposadr", "dofadr"))
    drives = [model.actuator(f"{joint.name}_drive").id for joint in held.joints]
    return model, mujoco.MjData(model), positions, speeds, drives
