"""Export a model to URDF, MJCF, C99 or JSON, with a card and a proof.

Reads    a model file, the covariance.json in its folder if there is one, and logs to replay
Writes   the exported file or files, covariance.json of the link parameters, result.json
Source   Wensing, Kim & Slotine 2018; Lee & Park 2018 (links that could exist)

Base parameters become links that could exist and have the same torque. Every term of the model is
carried exactly, approximated by the friction and damping that the target has, or lost; the card
says which, and what it costs in torque on a replayed log, or else on a simulated motion. The file
is loaded again (URDF in Pinocchio, MJCF in MuJoCo, C by the compiler) and its torque compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.altered import carry_over
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.errors import Check, InputRejected, UsageError, did_you_mean
from pipelines.estimation.consistency import Links, carried, consistent_links, prior_links
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.export.c_code import C
from pipelines.export.card import Card, Consistency, LinkValue, Proof, Replay, card
from pipelines.export.config import EXPORT
from pipelines.export.mjcf import mjcf
from pipelines.export.states import course, random_states
from pipelines.export.table import TABLE
from pipelines.export.target import Cause, Held, Loaded, Target, folded, held_by, rms
from pipelines.export.urdf import URDF, other_gravity
from pipelines.io.log import ExperimentLog, recording
from pipelines.io.model_file import (
    ModelFile,
    model_in,
    read_covariance,
    read_model,
    write_covariance,
)
from pipelines.io.option import option
from pipelines.io.output import write_text
from pipelines.io.schema import joint_unit
from pipelines.quality.segments import Mask
from pipelines.report.report import Report
from pipelines.simulation.plant import Plant
from pipelines.simulation.replay import held_torque, simulate_windows
from pipelines.stage import Inputs, Request, Stage, read_logs

__all__ = ["STAGE", "Card", "Settings", "compute", "read", "report"]

TARGETS: dict[str, Callable[[], Target]]
TARGETS = {"urdf": lambda: URDF, "mjcf": mjcf, "c": lambda: C, "json": lambda: TABLE}
_BODIES = ("urdf", "mjcf")  # whose readers need every number of a link


@dataclass(frozen=True)
class Settings:
    """Choose the model and the target."""

    model: str = option(
        "", "A model.json, or a folder of estimate-bps, extend or run; or 'rrr'.", "MODEL"
    )
    to: str = option("urdf", "urdf, mjcf, c or json.")


@dataclass(frozen=True, eq=False)
class _Material:
    """Hold the model and what is known of its accuracy."""

    model: ModelFile
    arm: Arm
    covariance: Array  # (base parameters, base parameters); NaN where nothing is known
    source: str  # the model.json that was taken of a folder


def read(request: Request, settings: Settings) -> Inputs:
    """Read the model, its covariance, and the logs to replay.

    Raises:
        UsageError: C02, no model or no such target was named, or a model without inertia; C04, no
            such file, or a folder without a model.
        InputRejected: S18, it is no model file, or the covariance is of another; S02, a log of
            another robot, or without torque.
    """
    if settings.to not in TARGETS:
        words = f"'{settings.to}' is no target{did_you_mean(settings.to, TARGETS)}"
        raise UsageError("C02", words, where="--to", remedy=f"one of {', '.join(TARGETS)}")
    if not settings.model:
        remedy = "name a model.json, or the shipped 'rrr'"
        raise UsageError("C02", "no model", where="export", remedy=remedy)
    given, source = Path(settings.model).absolute(), ""
    path = given
    if given.is_dir():
        path = model_in(given)
        source = f"{path.relative_to(given)} of the folder {given.name}"
    model = read_model(path if source else settings.model)
    arm = Arm.from_model(model, path)
    if not arm.p.any():
        words = f"the model {path.name} holds friction alone, no inertia"
        remedy = "record excitation logs and name the model.json of estimate-bps"
        raise UsageError("C02", words, where="export", remedy=remedy)
    inputs = read_logs(request, settings) if request.paths else Inputs()
    for opened in inputs.logs:
        if opened.log.n_joints != arm.n_joints or "tau" not in opened.log:
            words = f"{opened.log.n_joints} joints, the model has {arm.n_joints}"
            words = words if opened.log.n_joints != arm.n_joints else "no torque to compare"
            raise InputRejected("S02", words, opened.path, "replay a recording of this robot")
    sources = [path] if path.is_file() else []  # a shipped model is not one of the user's files
    covariance = np.diag([np.nan if p.std is None else p.std**2 for p in arm.base])
    beside = path.with_name("covariance.json")
    if sources and beside.is_file():
        names, known = read_covariance(beside)
        if missing := [p.name for p in arm.base if p.name not in names]:
            words = f"it has no {', '.join(missing)}: it is of another model"
            raise InputRejected("S18", words, beside, "put the model's own file there, or none")
        places = [names.index(p.name) for p in arm.base]
        covariance = known[np.ix_(places, places)]
        sources.append(beside)
    found = replace(inputs, sources=(*inputs.sources, *sources), robot_name=arm.robot.name)
    material = _Material(model, arm, covariance, source)
    return replace(found, label=f"{model.name}-{settings.to}", material=material)


def compute(inputs: Inputs, settings: Settings) -> Card:
    """Make the text of the target, load it again, and compare.

    Raises:
        InputRejected: D15, neither logs nor description tell links that could move.
        RuntimeError: the text has another torque than was meant: nothing is written.
    """
    known: _Material = inputs.material
    arm, validity = known.arm, known.model.validity
    target = TARGETS[settings.to]()
    flat = folded(arm)
    covariance = known.covariance
    if flat.body is not arm.body:  # a tilted base or a longer link has other base parameters
        covariance = carried(covariance, carry_over(arm.body, flat.body))
    links = _told(consistent_links(flat.body, flat.p, covariance))
    states, (_, assumed, impossible) = random_states(arm.robot, validity), prior_links(arm.robot)
    if settings.to in _BODIES and assumed and not links.exact:
        Plant.of(arm).refuse_unphysical(states.q)  # the assumed links alone would make it move
    held_flat = flat
    if target.consistent:
        values = links.base @ links.phi.ravel()
        base = (replace(q, value=float(x)) for q, x in zip(flat.base, values, strict=True))
        held_flat = replace(flat, base=tuple(base), extends=None)
    logged = [(opened.log, _motion(opened.log)) for opened in inputs.logs]
    whole_range = course(arm.robot, validity)
    motion = logged[0][1][0] if logged else whole_range
    held = held_by(target, held_flat, links, whole_range, motion)
    texts, notes = target.write(held)
    torque = target.seen(arm).torque(motion)
    there = target.load(texts, held, motion)
    replays = tuple(_replayed(log, moved, arm, (target, held)) for log, moved in logged)
    nearest = None if links.exact else rms(flat.torque(motion) - held_flat.torque(motion))
    said = Consistency(links.exact, links.distance, links.conflicts, impossible, assumed, nearest)
    return Card(
        settings.to,
        arm.name,
        arm.robot.name,
        tuple(joint.name for joint in held.joints),
        tuple(joint_unit("tau", revolute) for revolute in arm.robot.revolute),
        tuple(texts),
        (*_causes(held, target, motion, there), *_in_links(arm, flat)),
        said,
        _values(links, held),
        _proof(target, held, states),
        f"the log {logged[0][0].name}" if logged else "a simulated motion",
        rms(torque),
        None if there is None else rms(there.torque - torque),
        replays,
        (*held.notes, *notes),
        validity,
        texts,
        links.covariance,
        known.source,
        float(np.linalg.norm(held.gravity)),
        target.reader(held),
    )


def _told(links: Links) -> Links:
    """Return the links whose covariance is NaN, and not zero, where the logs tell nothing."""
    untold = np.array(["logs" not in origin for origin in links.origin])
    covariance = np.where(untold | untold[:, None], np.nan, links.covariance)
    return replace(links, covariance=covariance)


def _proof(target: Target, held: Held, states: Motion) -> Proof | None:
    """Return how far the file, without what is written with an error, is off what was meant."""
    exact = replace(held, arm=target.exact(held.arm))
    loaded, meant = target.load(target.write(exact)[0], exact, states), exact.torque(states, target)
    if loaded is None:
        return None
    size = np.maximum(np.abs(meant).max(axis=0), np.abs(meant).max() * EXPORT.agreement)
    error = float((np.abs(loaded.torque - meant).max(axis=0) / size).max())
    if not error <= EXPORT.agreement:
        raise RuntimeError(f"{loaded.program} has another torque than was meant, by {error:.2g}")
    return Proof(loaded.program, len(meant), error, loaded.says)


def _motion(log: ExperimentLog) -> tuple[Motion, Mask]:
    """Return the motion of a log, and which samples count."""
    found = reconstruct(log, Reconstruction())
    good: Mask = np.zeros(log.n_samples, dtype=bool)
    good[found.good.kept] = found.good.fit
    return found.motion, good & np.isfinite(log.tau).all(axis=1)


def _replayed(
    log: ExperimentLog, moved: tuple[Motion, Mask], arm: Arm, made: tuple[Target, Held]
) -> Replay:
    """Return how far model and file are off a log; where the target simulates, in position too."""
    (motion, good), (target, held), tau = moved, made, log.tau
    texts = target.write(held)[0]
    there, ours, theirs = target.load(texts, held, motion), None, None
    if target.simulate is not None:
        held_tau, step = held_torque(recording(log)), log.sample_time
        length = max(2, round(EXPORT.window / step))
        windows = simulate_windows(Plant.of(arm), motion, held_tau, step, length, good)
        q = target.simulate(texts, held, motion, held_tau, windows)
        inside = np.isfinite(windows.q).all(axis=1)
        ours = rms((windows.q - motion.q)[inside])
        theirs = None if q is None else rms((q - motion.q)[inside])
    error = None if there is None else rms((tau - there.torque)[good])
    model_error = rms((tau - arm.torque(motion))[good])
    return Replay(log.name, rms(tau[good]), model_error, error, ours, theirs)


def _causes(held: Held, target: Target, motion: Motion, there: Loaded | None) -> tuple[Cause, ...]:
    """Return the causes; those that a target writes with an error, with the error of all such."""
    found = []
    for cause in held.causes:
        name = cause.place.partition(":")[0]
        if cause.carried == "exactly" and (how := target.approximated.get(name)):
            cost = None if there is None else rms(there.torque - held.torque(motion, target))
            cause = replace(cause, carried="approximated", how=how, cost=cost)
        if cause.carried == "exactly" and name in target.forward_only:
            cause = replace(cause, how="in the drive: in simulations, not in inverse dynamics")
        found.append(cause)
    return tuple(found)


def _in_links(arm: Arm, flat: Arm) -> tuple[Cause, ...]:
    """Return the causes that went into the links, the geometry or gravity."""
    kept = {acting.place for acting in flat.effects}
    how = "in the links, the geometry or gravity"
    gone = (one.place for one in arm.effects if one.place not in kept)
    return tuple(Cause(place, "exactly", how) for place in gone)


def _values(links: Links, held: Held) -> tuple[LinkValue, ...]:
    found = []
    for k, (value, std) in enumerate(zip(links.phi.ravel(), links.std, strict=True)):
        told = "logs" in links.origin[k] and np.isfinite(std)
        joint, spread = held.joints[k // 10].name, float(std) if told else None
        own = links.names[k], float(value), spread, links.units[k], links.origin[k]
        found.append(LinkValue(joint, *own))
    return tuple(found)


def _checks(result: Card) -> tuple[Check, ...]:
    """Return what is lost or approximated, assumed or impossible links, and a missing proof."""
    found, said = [], result.consistency
    for cause in result.causes:
        if cause.carried != "exactly":
            words = f"{cause.place} is {cause.carried} in {result.target}; {_cost(cause, result)}"
            remedy = "export to c or json, which hold more terms"
            remedy = "export to json, which holds every term" if result.target == "c" else remedy
            found.append(Check.of("S18", "warn", words, result.model, remedy))
    if said.assumed and result.target in _BODIES:
        words = f"nothing describes the links of {', '.join(said.assumed)}: those parts of their"
        words = f"{words} mass, centre and inertia that torque does not show are assumed"
        remedy = "give each a [joint.link] with mass, com and inertia, from CAD or weighed"
        found.append(Check.of("S18", "warn", words, result.robot, remedy))
    if result.target == "urdf" and (words := other_gravity(result.gravity)):
        remedy = "set the gravity in the program that reads the URDF"
        found.append(Check.of("S18", "warn", words, result.robot, remedy))
    if said.impossible:
        words = f"no body could have the described link of {', '.join(said.impossible)}"
        found.append(Check.of("S17", "warn", words, result.robot, "correct the description"))
    if said.conflicts:
        words = "no links that could exist have these base parameters: the nearest ones are"
        words = f"{words} {said.distance:.2g} standard deviations away; the conflict is at"
        remedy = "look for a cause that the model lacks, or record longer excitation"
        words = f"{words} {', '.join(said.conflicts)}"
        found.append(Check.of("D15", "warn", words, result.robot, remedy))
    if result.proof is None:
        words = "the exported file was not loaded again: its target is not installed"
        remedy = f"install {TARGETS[result.target]().needs} and export again"
        found.append(Check.of("C02", "warn", words, result.target, remedy))
    return tuple(found)


def _cost(cause: Cause, result: Card) -> str:
    """Return the torque error of a cause in words, at the joint where it is largest."""
    if cause.cost is None:
        return "torque error not measured"
    worst = int(np.argmax(cause.cost))
    if cause.cost[worst] <= EXPORT.agreement * result.torque_rms.max():
        return "inverse dynamics of this motion does not show it"
    return f"torque error {cause.cost[worst]:.3g} {result.units[worst]} rms"


def write(result: Card, folder: Path, request: Request) -> None:
    """Write the exported texts, and the covariance of the link parameters."""
    for name, text in result.texts.items():
        write_text(folder / name, text)
    names = [link.name for link in result.links]
    write_covariance(folder / "covariance.json", names, result.covariance)


def report(result: Card) -> Report:
    """Return the card."""
    return card(result)


STAGE = Stage(
    "export",
    "Export a model",
    Settings,
    compute,
    report,
    read,
    write,
    checks=_checks,
    sessions="folder",
)
