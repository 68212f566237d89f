"""Judge the compensated payload on random machines: how often it is given, and how often invented.

    python -m benchmarks.compensated_payload --healthy 100 --loaded 30 --first 9000

Machines of `torque_boundary`; a third are described exactly, a third wrong by up to 30 %, a sixth
by up to 5 %, a sixth not at all. Their reference logs have another motion, and friction that
differs by up to 15 % of each joint's. The controller of a loaded machine subtracts a body as heavy
as 0.3 to 1.5 last links.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.hidden_effects.table import wilson
from benchmarks.torque_boundary import (
    DOWN,
    Array,
    Machine,
    draw,
    friction_torque,
    inverse_dynamics,
    logged,
    random_motion,
)
from pipelines.estimation.checks.boundary import torque_boundary
from pipelines.estimation.checks.payload import CompensatedPayload
from pipelines.io.log import ExperimentLog
from pipelines.io.robot import RobotDescription


def _machine(seed: int) -> Machine:
    """Return machine `seed`; one that is described "near" with its links wrong by up to 5 %."""
    machine = draw(seed)
    if described(seed) != "near":
        return machine
    rng, joints = np.random.default_rng([50, 9, seed]), []
    for joint in machine.robot.joints:
        assert joint.link is not None
        wrong = rng.uniform(0.95, 1.05, 5)
        x, y, z = (float(a * b) for a, b in zip(joint.link.com, wrong[2:], strict=True))
        inertia = tuple(float(a * wrong[1]) for a in joint.link.inertia)
        link = replace(joint.link, mass=joint.link.mass * wrong[0], com=(x, y, z), inertia=inertia)
        joints.append(replace(joint, link=link))
    return replace(machine, told=replace(machine.told, joints=tuple(joints)))


def _loaded_robot(
    robot: RobotDescription, mass: float, centre: Array, size: float
) -> RobotDescription:
    """Return `robot` with a ball of radius `size` [m] at `centre` of the last link."""
    *links, last = robot.joints
    assert last.link is not None
    link, r = last.link, centre
    total = link.mass + mass
    com = (link.mass * np.array(link.com) + mass * r) / total
    about = mass * ((r @ r + 0.4 * size**2) * np.eye(3) - np.outer(r, r))
    added = np.array(
        [about[0, 0], about[1, 1], about[2, 2], -about[0, 1], -about[0, 2], -about[1, 2]]
    )
    x, y, z = map(float, com)
    xx, yy, zz, xy, xz, yz = map(float, np.array(link.inertia) + added)
    heavier = replace(link, mass=total, com=(x, y, z), inertia=(xx, yy, zz, xy, xz, yz))
    return replace(robot, joints=(*links, replace(last, link=heavier)))


def _recorded(machine: Machine, role: str, lacking: Array | float, seed: int) -> ExperimentLog:
    """Return a log of `machine` that lacks a torque (samples, joints)."""
    rng = np.random.default_rng([50, 7, seed, len(role)])
    load = inverse_dynamics(machine.robot, machine.q, machine.dq, machine.ddq, DOWN)
    tau = load + machine.rotor * machine.ddq + friction_torque(machine, load) - lacking
    tau = tau + machine.noise * rng.normal(size=tau.shape)
    dither = 0.5 * machine.step * rng.normal(size=machine.q.shape)
    q = machine.step * np.round((machine.q + dither) / machine.step)
    return replace(logged(machine, q, tau), role=role, name=f"{role}-{seed}")


def session(seed: int, loaded: bool) -> tuple[ExperimentLog, ExperimentLog, float]:
    """Return a log of machine `seed`, its reference, and the mass that is subtracted."""
    machine, rng = _machine(seed), np.random.default_rng([50, 8, seed])
    n = machine.q.shape[1]
    mass, lacking = 0.0, np.zeros_like(machine.q)
    if loaded:
        link = machine.robot.joints[-1].link
        assert link is not None
        mass = float(rng.uniform(0.3, 1.5)) * link.mass
        arm = _loaded_robot(machine.robot, mass, rng.normal(size=3) * 0.08, 0.05)
        motion = machine.q, machine.dq, machine.ddq
        lacking = inverse_dynamics(arm, *motion, DOWN) - inverse_dynamics(
            machine.robot, *motion, DOWN
        )
    revolute = np.array(machine.robot.revolute)
    t, q, dq, ddq = random_motion(rng, n, machine.q.mean(axis=0), revolute)
    friction = dict(machine.friction)
    for name in ("coulomb", "viscous"):
        friction[name] = friction[name] * rng.uniform(0.85, 1.15, n)
    before = replace(machine, t=t, q=q, dq=dq, ddq=ddq, friction=friction)
    return (
        _recorded(machine, "identify", lacking, seed),
        _recorded(before, "reference", 0.0, seed),
        mass,
    )


def described(seed: int) -> str:
    """Return whether machine `seed` is described "right", "near", "wrong" or not, "none"."""
    machine = draw(seed)
    if machine.told.joints[0].link is None:
        return "near" if seed % 2 else "none"
    return "right" if machine.told.joints == machine.robot.joints else "wrong"


def subtracted(seed: int, loaded: bool, reference: bool) -> tuple[CompensatedPayload | None, float]:
    """Return the payload that is found of machine `seed`, and the mass that is subtracted."""
    log, before, mass = session(seed, loaded)
    found = torque_boundary([log, before] if reference else [log])
    return None if found is None else found.payload, mass


def main() -> None:
    """Print a line for each kind of machine, with Wilson intervals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--healthy", type=int, default=100, help="machines without a payload")
    parser.add_argument("--loaded", type=int, default=30, help="machines with a payload")
    parser.add_argument("--first", type=int, default=9000, help="first seed")
    parser.add_argument("--verbose", action="store_true", help="print every machine")
    wanted = parser.parse_args()
    for loaded, count in ((False, wanted.healthy), (True, wanted.loaded)):
        for reference in (True, False):
            rows = []
            for seed in range(wanted.first, wanted.first + count):
                payload, mass = subtracted(seed, loaded, reference)
                rows.append((seed, described(seed), payload, mass))
                if wanted.verbose and payload is not None:
                    print(*rows[-1][:2], f"true {mass:.3g}", payload, flush=True)
            name = f"{'loaded' if loaded else 'healthy'}, {'with' if reference else 'no'} reference"
            for kind in ("right", "near", "wrong", "none"):
                _line(f"{name}, described {kind}", [row for row in rows if row[1] == kind])
            _line(name, rows)


def _line(name: str, rows: list[tuple[int, str, CompensatedPayload | None, float]]) -> None:
    found = [(payload, mass) for _, _, payload, mass in rows if payload is not None]
    claimed = [(p, mass) for p, mass in found if p.present]
    denied = sum(p.present is False for p, _ in found)
    low, high = wilson(len(claimed), max(len(rows), 1))
    known = [(p.mass, p.std, mass) for p, mass in found if p.mass is not None and p.std is not None]
    inside = sum(abs(value - mass) < 2.0 * std for value, std, mass in known)
    print(
        f"{name:42s} given {len(claimed):3d} of {len(rows):3d} [{low:.3f}, {high:.3f}], "
        f"absent {denied:3d}, not identifiable {len(rows) - len(claimed) - denied:3d}; "
        f"mass within two deviations {inside} of {len(known)}",
        flush=True,
    )


if __name__ == "__main__":
    main()
