"""URDFs with the structures of well-known robots: branches, mimic, fixed, floating and continuous joints, missing inertias.

    text = urdf_of("panda", seed=1)

A structure is written as paths of links, joined by a letter for the joint's type and digits for what its child is like:

    r revolute   c continuous   p prismatic   f fixed   g floating   l planar   m mimic (revolute)   n mimic (prismatic)
    0 child without <inertial>   1 child with a mass and nothing more   8 limits that mean none

Geometry, inertias, axes and limits are drawn from the seed; every <inertial> has an origin with its own rotation.
"""

from __future__ import annotations

import re

import numpy as np

__all__ = ["STRUCTURES", "urdf_of"]

_KINDS = {"r": "revolute", "c": "continuous", "p": "prismatic", "f": "fixed", "g": "floating", "l": "planar",
          "m": "revolute", "n": "prismatic"}

_UR = "base_link -r- shoulder -r- upper_arm -r- forearm -r- wrist_1 -r- wrist_2 -r- wrist_3"
_SEVEN = "{0}0 -r- {0}1 -r- {0}2 -r- {0}3 -r- {0}4 -r- {0}5 -r- {0}6 -r- {0}7"
_ROBOTIQ = ("gripper -r- left_knuckle -f- left_finger; gripper -m- right_knuckle -f- right_finger; "
            "gripper -m- left_inner; gripper -m- right_inner; left_finger -m- left_tip; right_finger -m- right_tip")

STRUCTURES: dict[str, str] = {
    "ur5": f"world -f0- {_UR} -f0- flange -f0- tool0; base_link -f0- base",
    "ur10e-robotiq": f"world -f0- {_UR} -f0- flange -f- gripper; {_ROBOTIQ}",
    "panda-hand": f"{_SEVEN.format('panda_link')} -f0- panda_link8 -f- panda_hand -p- leftfinger; panda_hand -n- rightfinger",
    "kinova-gen3": "base_link -c- l1 -r- l2 -c- l3 -r- l4 -c- l5 -r- l6 -c- bracelet -f0- camera; bracelet -f- gripper; "
                   + _ROBOTIQ,
    "scara-no-inertia": "base -r- inner -r0- outer -p0- quill -r1- flange",
    "gantry-limits": "frame -p8- bridge -p8- trolley -p- mast -c8- wrist",
    "palletiser": "base -r- turret -r- lower -r- upper -m- levelling -r- flange; turret -m- rod -f- rod_end",
    "quadruped-arm": "world -g- trunk -r- fl1 -r- fl2; trunk -r- fr1 -r- fr2; trunk -r- arm1 -r- arm2 -r- arm3",
    "floating-table": "world -g- table -f- base_link; " + _UR,
    "hand": "; ".join(f"palm -r- f{k}a -r- f{k}b -r- f{k}c -r- f{k}d -f0- f{k}tip" for k in range(4)),
    "two-tools": "base -r- a -r- b -f- plate -f- welder -f- nozzle; plate -f- camera -f0- lens",
    "continuous-limits": "base -c8- a -c8- b -r8- c -c- d",
    "loose-world": f"world ; {_UR} -f0- tool0",
    "masses-alone": "base -r1- a -r1- b -f1- c -r1- d",
    "one-joint": "base -r- flywheel",
}


def urdf_of(name: str, seed: int) -> str:
    """Return the URDF of a structure, its numbers drawn from `seed`."""
    rng = np.random.default_rng([seed, *name.encode()])
    links: dict[str, str] = {}
    joints: list[str] = []
    first = ""
    for path in STRUCTURES[name].split(";"):
        words = re.split(r"\s*-(\w)(\w*)-\s*", path.strip())
        links.setdefault(words[0].strip(), _inertial(rng, ""))
        for k in range(1, len(words), 3):
            parent, kind, flags, child = words[k - 1].strip(), words[k], words[k + 1], words[k + 2].strip()
            links[child] = _inertial(rng, flags)
            joints.append(_joint(rng, f"j{len(joints) + 1}_{child}", kind, flags, parent, child, first))
            first = first or (f"j{len(joints)}_{child}" if kind == "r" else "")
    body = "\n".join([*(f'  <link name="{link}">{inside}</link>' for link, inside in links.items()), *joints])
    return f'<?xml version="1.0"?>\n<robot name="{name}" xmlns:xacro="http://ros.org/wiki/xacro">\n{body}\n</robot>\n'


def _triple(values: object) -> str:
    return " ".join(f"{value:.6g}" for value in values)  # type: ignore[attr-defined]


def _inertial(rng: np.random.Generator, flags: str) -> str:
    mass = f'<mass value="{rng.uniform(0.1, 8.0):.5g}"/>'
    if "0" in flags:
        return ""
    if "1" in flags:
        return f"<inertial>{mass}</inertial>"
    second = np.diag(rng.uniform(1e-4, 5e-2, 3))
    inertia = np.trace(second) * np.eye(3) - second
    moments = "".join(f' {key}="{inertia[i, i]:.8g}"' for i, key in enumerate(("ixx", "iyy", "izz")))
    products = "".join(f' {key}="{rng.uniform(-1e-5, 1e-5):.4g}"' for key in ("ixy", "ixz", "iyz"))
    return (f'<inertial>{mass}<origin xyz="{_triple(rng.uniform(-0.2, 0.2, 3))}" rpy="{_triple(rng.uniform(-3, 3, 3))}"/>'
            f"<inertia{moments}{products}/></inertial>")


def _joint(rng: np.random.Generator, name: str, kind: str, flags: str, parent: str, child: str, first: str) -> str:
    origin = f'<origin xyz="{_triple(rng.uniform(-0.4, 0.4, 3))}" rpy="{_triple(rng.uniform(-3, 3, 3))}"/>'
    axis = "" if kind in "fg" else f'<axis xyz="{_triple(rng.choice([[1, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0, 0.8]]))}"/>'
    limit = f'<limit lower="{-rng.uniform(0.5, 3):.3f}" upper="{rng.uniform(0.5, 3):.3f}" effort="80" velocity="2"/>'
    if "8" in flags:
        limit = str(rng.choice(['<limit lower="-inf" upper="inf" effort="inf" velocity="1e16"/>',
                                '<limit lower="-1e16" upper="1e16" effort="3000" velocity="2"/>',
                                '<limit effort="1e10" velocity="2"/>']))
        if kind == "c":
            limit = '<limit lower="1" upper="-1" effort="20" velocity="2"/>'
    mimic = f'<mimic joint="{first}" multiplier="-1"/>' if kind in "mn" else ""
    inside = "" if kind in "fgl" else limit + mimic
    return (f'  <joint name="{name}" type="{_KINDS[kind]}">{origin}<parent link="{parent}"/><child link="{child}"/>'
            f"{axis}{inside}</joint>")
