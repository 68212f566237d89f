"""Check the samples of a log: missing, absurd, constant, saturated, glitches, wraps, resolution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io import schema
from pipelines.io.limits import ABSURD, GAP_LIMIT, percent, sentinels
from pipelines.quality.config import CONFIG
from pipelines.quality.segments import long_blocks, torque_limit
from pipelines.quality.subject import NotTested, Subject, flagged, many, spread

_REPAIR = "look at this channel's cable and its place in the recorder, and record again"


def missing_samples(s: Subject) -> list[Check]:
    """D01, D02: a few samples may be missing (NaN); of a signal that no fit needs, all."""
    needed = ("q", "tau", "v") if s.log.experiment == "frf" else ("q", "tau")
    found = []
    for name in (name for name in s.log.signals if name in schema.SIGNALS and name != "t"):
        undefined = np.isnan(s.log[name])
        for j, at in flagged(undefined):
            whole, blocks = at.size == len(undefined), len(long_blocks(undefined[:, j]))
            words = f"{name} of joint {j + 1}: {at.size} of {len(undefined)} samples are missing"
            words = f"{name} of joint {j + 1}: there is no measurement at all" if whole else words
            level: Level = "repair"
            code, remedy, gate = "D02", _REPAIR, False
            if name not in needed:
                code, level, gate = "D02" if whole else "D01", "warn", whole
                remedy = "leave the signal out, or record it again"
            elif at.size > CONFIG.gone * len(undefined):
                level = "reject"
            elif blocks:
                words = f"{at.size} samples of {name} are missing, {many(blocks, 'time')} more "
                words += f"than {GAP_LIMIT} in a row; the log is split there"
            else:
                words = f"{many(at.size, 'sample')} of {name} missing, never more than {GAP_LIMIT} "
                words += "in a row; treated as not measured"
                code, remedy = "D01", "none needed if few"
            say = s.say(code, level, words, remedy, gate, signal=name, joint=j, sample=int(at[0]))
            found.append(say)
    return found or s.ok("D01", "no sample is missing")


def absurd_samples(s: Subject) -> list[Check]:
    """D03: infinite, astronomically large, and filler values such as -999."""
    found = []
    for name in (name for name in s.log.signals if name != "t"):
        x = s.log[name]
        bad = np.abs(x) >= ABSURD
        if name in ("q", "tau"):
            bad |= sentinels(x)
        for j, at in flagged(bad):
            values = ", ".join(f"{v:g}" for v in np.unique(x[at, j])[:4])
            samples = ", ".join(map(str, at[:8]))
            words = f"{many(at.size, 'sample')} of {name} with the value {values}, which is no "
            words += f"measurement (samples {samples}{', …' * bool(at[8:].size)})"
            remedy = "mark what was not measured as NaN, or look at the sensor"
            level: Level = "repair" if at.size <= CONFIG.few * s.log.n_samples else "reject"
            found.append(s.say("D03", level, words, remedy, signal=name, joint=j, sample=at[0]))
    return found or s.ok("D03", "no infinite, astronomical or filler value")


def constant_channels(s: Subject) -> list[Check]:
    """D04: what this experiment has to move does move."""
    log, found = s.good.log, []
    reference = spread(log["q_ref"]) if "q_ref" in log else np.zeros(log.n_joints)
    torque = spread(log.tau)
    for j in range(log.n_joints):
        tau, q = (x[np.isfinite(x[:, j]), j] for x in (log.tau, log.q))
        if not tau.size or not q.size:
            continue  # D02 is of it
        asked = j in s.moving or (reference[j] > CONFIG.travel and log.experiment != "hold")
        if s.travel[j] == 0.0 and asked:
            words = f"q of joint {j + 1} is constant ({q[0]:.6g})"
            found.append(s.say("D04", "reject", words, _REPAIR, signal="q", joint=j))
        moves = j in s.moving or s.travel[j] > CONFIG.moved
        driven = log.experiment == "friction" and tau[0] != 0.0  # by a constant torque
        if torque[j] == 0.0 and moves and not driven:
            words = f"tau of joint {j + 1} is constant ({tau[0]:.6g}) while the joint moves"
            found.append(s.say("D04", "reject", words, _REPAIR, signal="tau", joint=j))
    return found or s.ok("D04", "every channel that has to move does")


def saturation(s: Subject) -> list[Check]:
    """D05: the drive could give the torque that was commanded."""
    found, tau, limits = [], np.abs(s.good.log.tau), torque_limit(s.log)
    for j, at in flagged(s.good.saturated):
        least, peak, limit = float(tau[at, j].min()), float(tau[at, j].max()), limits[j]
        where = f"at or beyond the described limit of {limit:.4g}, up to {peak:.4g}"
        if least < 0.99 * limit:
            where = f"at a flat top at {least:.4g}"
        share = at.size / len(tau)
        words = f"{percent(share, 2)} of the torque samples lie {where} {s.unit('tau', j)}; no fit "
        words += "uses them"
        remedy = "move slower or with less acceleration; a saturated drive hides what the arm needs"
        if peak > CONFIG.twice * limit:
            remedy += "; or look for a gear ratio or torque constant applied twice"
        gate, sample = share > CONFIG.saturated, s.good.kept[at[0]]
        say = s.say("D05", "warn", words, remedy, gate, signal="tau", joint=j, sample=sample)
        found.append(say)
    peaks = s.with_units("tau", np.nanmax(tau, axis=0, initial=0.0).tolist())
    return found or s.ok("D05", f"the torque stays below its limits, at most {peaks}", signal="tau")


def glitches(s: Subject) -> list[Check]:
    """D06: single samples far from their neighbours."""
    found, remedy = [], "look at the shielding of the encoder and at the recorder's transmission"
    for name, flags in (("q", s.good.position_spikes), ("tau", s.good.torque_spikes)):
        for j, at in flagged(flags):
            words = f"{many(at.size, 'sample')} of {name} too far from the neighbours; left out"
            sample = s.good.kept[at[0]]
            found.append(s.say("D06", "repair", words, remedy, signal=name, joint=j, sample=sample))
    return found or s.ok("D06", "no sample is far from its neighbours")


def wraps(s: Subject) -> list[Check]:
    """D07: the position does not jump, by a turn or otherwise."""
    found, wrapped = [], np.diff(s.good.wrapped, axis=0)
    jumped = np.where(s.good.jumped[1:], np.diff(s.good.log.q, axis=0), 0.0)
    for steps, lost in ((wrapped, False), (jumped, True)):
        for j, at in flagged(steps != 0.0):
            times, size = many(at.size, "time"), abs(steps[at[0], j])
            words = f"the encoder wraps {times} by {size:.6g} {s.unit('q', j)}; unwrapped"
            remedy = "let the recorder count turns"
            if lost:
                words = f"the position jumps {times}, first by {size:.4g} {s.unit('q', j)}, which "
                words += "is no turn and no counter's range; the log is split there"
                remedy = "look at the encoder: it loses counts"
            sample = s.good.kept[at[0] + 1]
            say = s.say("D07", "warn", words, remedy, lost, signal="q", joint=j, sample=sample)
            found.append(say)
    return found or s.ok("D07", "the position neither wraps nor jumps", signal="q")


def resolution(s: Subject) -> Sequence[Check | NotTested]:
    """D08: encoders count as finely as described; the observer's noise is R = δ² / 12."""
    found: list[Check | NotTested] = []
    hidden = ", ".join(str(j + 1) for j, step in enumerate(s.good.steps) if step is None)
    for j, step in enumerate(s.good.steps):
        declared, q = s.log.robot.joints[j].encoder_resolution, s.good.log.q[:, j]
        if step is None or np.unique(q[np.isfinite(q)]).size < CONFIG.distinct:
            continue
        coarse, told = s.travel[j] < CONFIG.few_steps * step, f"{s.travel[j] / step:.0f} in all"
        if declared:
            coarse, told = step > CONFIG.coarse * declared, f"the description says {declared:.3g}"
        if coarse:
            unit = s.unit("q", j)
            words = f"the encoder counts in steps of {step:.3g} {unit}, {told}; noise is set to "
            words += f"R = δ²/12 = {step**2 / 12.0:.3g} {unit}² from the data"
            remedy = "correct encoder_resolution, or look for bits lost on the way"
            found.append(s.say("D08", "warn", words, remedy, signal="q", joint=j))
    if not found and any(s.good.steps):
        found += s.ok("D08", f"encoder steps: {s.with_units('q', s.good.steps)}", signal="q")
    if hidden:
        words = f"no step of the encoder shows in the positions of joint {hidden}"
        found += s.cannot_tell("D08", words, signal="q")
    return found


SIGNAL_CHECKS = (missing_samples, absurd_samples, constant_channels, saturation, glitches, wraps,
                 resolution)  # fmt: skip
