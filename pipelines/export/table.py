"""Write a flat JSON table: frames of the joints, and every number with std, unit and origin.

A row has `of` ("link", "base", "friction" or "effect"), `place`, `name`, `value`, `std`, `unit`,
`origin`; a `std` that the logs do not tell is null. Link parameters are about the link's frame: m,
first moments, moments and products of inertia, products with positive sign, Ixy = +∫xy dm. The base
parameters are those of the links of the same table: the model's own, but where no links that could
exist have these.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.dynamics.chain import STANDARD, inverse_dynamics
from pipelines.dynamics.kinematics import Placement, SerialChain
from pipelines.effects import find_effect
from pipelines.export.target import Held, Loaded, Target
from pipelines.io.model_file import UNKNOWN
from pipelines.io.results import encode, json_text

__all__ = ["TABLE"]

_KEYS = ("of", "place", "name", "value", "std", "unit", "origin")


def _write(held: Held) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the text of the table."""
    joints = [
        asdict(replace(joint, origin=None, inertia=None))  # type: ignore[arg-type]
        | {"rotation": joint.origin.rotation, "xyz": joint.origin.position}
        for joint in held.joints
    ]
    links, rows = held.links, list[tuple[Any, ...]]()
    for k, value in enumerate(links.phi.ravel()):
        more = (value, links.std[k], links.units[k], links.origin[k])
        rows.append(("link", held.joints[k // 10].name, links.names[k], *more))
    rows += [("base", "", p.name, p.value, p.std, p.unit, p.origin) for p in held.arm.base]
    for kind, members in (("friction", held.arm.friction), ("effect", held.arm.effects)):
        for acting in members:
            for q in acting.parameters:
                rows.append((kind, acting.place, q.name, q.value, q.std, q.unit, q.origin))
    table = {
        "format": "rrrid-export",
        **UNKNOWN,
        "model": held.arm.name,
        "gravity": held.gravity,
        "joints": joints,
        "tool": {"rotation": held.tool.rotation, "xyz": held.tool.position},
        "table": [dict(zip(_KEYS, row, strict=True)) for row in rows],
    }
    return {f"{held.name}.json": json_text(encode(table)[0])}, ()


def _load(texts: Mapping[str, str], held: Held, motion: Motion) -> Loaded:
    """Return the torque of frames, links and causes as a reader of the table has them."""
    from scipy.spatial.transform import Rotation

    (text,) = texts.values()
    table, before, after = json.loads(text), [], []
    values = {row["name"]: row["value"] for row in table["table"] if row["of"] == "link"}
    phi = [values[f"{key}{i + 1}"] for i in range(len(table["joints"])) for key in STANDARD]
    for joint in table["joints"]:
        aligned = Rotation.align_vectors([joint["axis"]], [[0.0, 0.0, 1.0]])[0].as_matrix()
        before.append(Placement(np.array(joint["rotation"]) @ aligned, np.array(joint["xyz"])))
        after.append(Placement(aligned.T, np.zeros(3)))
    turning = tuple(bool(joint["revolute"]) for joint in table["joints"])
    frames = np.zeros(len(before)), tuple(before), tuple(after), np.zeros(3)
    chain = SerialChain(turning, *frames, np.array(table["gravity"]))
    torque = inverse_dynamics(chain, motion.q, motion.dq, motion.ddq, np.array(phi))
    told = {row["name"]: row["value"] for row in table["table"] if row["of"] == "base"}
    base = tuple(replace(known, value=told[known.name]) for known in held.arm.base)
    rigid = replace(held.arm, base=base, friction=(), effects=(), extends=None)
    friction, effects = (_causes(table["table"], kind) for kind in ("friction", "effect"))
    causes = replace(rigid, friction=friction, effects=effects).torque(motion)
    return Loaded("a reader of the table", torque + causes - rigid.torque(motion))


def _causes(rows: Sequence[Mapping[str, Any]], kind: str) -> tuple[Acting, ...]:
    """Return the causes of a kind; a name that comes again begins another one at that place."""
    found = list[tuple[str, dict[str, float]]]()
    for row in rows:
        if row["of"] != kind:
            continue
        if not found or found[-1][0] != row["place"] or row["name"] in found[-1][1]:
            found.append((row["place"], {}))
        found[-1][1][row["name"]] = row["value"]
    causes = list[Acting]()
    for place, values in found:
        name, _, joint = place.partition(":")
        causes.append(Acting.of(find_effect(name)(joint=int(joint) if joint else None), values))
    return tuple(causes)


TABLE = Target(lambda acting: acting, _write, _load, "")
