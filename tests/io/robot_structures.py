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
    "panda-two-fingers": f"{_SEVEN.format('panda_link')} -f0- panda_link8 -f- panda_hand -p- left; panda_hand -p- right",
    "panda-arm": f"{_SEVEN.format('panda_link')} -f0- panda_link8",
    "kinova-gen3": "base_link -c- l1 -r- l2 -c- l3 -r- l4 -c- l5 -r- l6 -c- bracelet -f0- camera; bracelet -f- gripper; "
                   + _ROBOTIQ,
    "kinova-jaco": "root -f- base -c- l1 -r- l2 -r- l3 -c- l4 -c- l5 -c- hand -r- f1 -r- f1t; "
                   "hand -r- f2 -r- f2t; hand -r- f3 -r- f3t",
    "baxter": "base -f0- torso -r- head -r- screen; torso -f- pedestal; torso -f0- left0; torso -f0- right0; "
              f"{_SEVEN.format('left')} -f- lg -p- lgl; lg -p- lgr; {_SEVEN.format('right')} -f- rg -p- rgl; rg -n- rgr",
    "yumi": "world -f0- body; body -f0- a0; body -f0- b0; "
            f"{_SEVEN.format('a')} -f- ga -p- gal; ga -n- gar; {_SEVEN.format('b')} -f- gb -p- gbl; gb -n- gbr",
    "scara": "base -r- inner -r- outer -p- quill -r- flange -f- tool",
    "scara-no-inertia": "base -r- inner -r0- outer -p0- quill -r1- flange",
    "fetch": "base_link -c- l_wheel; base_link -c- r_wheel; base_link -p- torso -r- head -r- tilt; "
             "torso -r- s1 -r- s2 -c- upper -r- elbow -c- fore -r- flex -c- roll -f- gripper -p- rf; gripper -p- lf",
    "tiago": "base_footprint -f0- base -c- wl; base -c- wr; base -f- caster; base -p- torso -r- h1 -r- h2; "
             "torso -r- a1 -r- a2 -r- a3 -r- a4 -r- a5 -r- a6 -r- a7 -f- ft -f0- tool",
    "husky-ur5": f"base -c- w1; base -c- w2; base -c- w3; base -c- w4; base -f- base_link; {_UR} -f0- ee",
    "iiwa": f"world -f0- {_SEVEN.format('iiwa_link_')} -f0- iiwa_link_ee",
    "gantry": "frame -p- bridge -p- trolley -p- mast -r- wrist -f- tool",
    "gantry-limits": "frame -p8- bridge -p8- trolley -p- mast -c8- wrist",
    "palletiser": "base -r- turret -r- lower -r- upper -m- levelling -r- flange; turret -m- rod -f- rod_end",
    "stanford": "base -r- a -r- b -p- c -r- d -r- e -r- f",
    "quadruped-arm": "world -g- trunk -r- fl1 -r- fl2; trunk -r- fr1 -r- fr2; trunk -r- arm1 -r- arm2 -r- arm3",
    "planar-base": "odom -l- base -r- a1 -r- a2 -r- a3",
    "floating-table": "world -g- table -f- base_link; " + _UR,
    "xarm-gripper": f"world -f0- {_SEVEN.format('link')} -f- xarm_gripper_base -r- drive; xarm_gripper_base -m- left_inner; "
                    "xarm_gripper_base -m- right_outer -m- right_finger",
    "sawyer": "base -f0- pedestal; base -f0- right0; right0 -r- head -f0- camera; right0 -f- torso; "
              + _SEVEN.format("right"),
    "dobot": "base -r- turret -r- rear -r- fore -m- wrist -r- suction",
    "pr2": "base -c- caster -c- wheel; base -p- torso -r- l1 -r- l2 -c- l3 -r- l4 -c- l5; "
           "torso -r- r1 -r- r2 -c- r3 -r- r4 -c- r5; torso -r- pan -r- tilt",
    "hand": "; ".join(f"palm -r- f{k}a -r- f{k}b -r- f{k}c -r- f{k}d -f0- f{k}tip" for k in range(4)),
    "two-tools": "base -r- a -r- b -f- plate -f- welder -f- nozzle; plate -f- camera -f0- lens",
    "rail-and-arm": "rail -p- base_link; " + _UR,
    "so-arm": "base -r- a -r- b -r- c -r- d -f- gripper -r- jaw",
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
