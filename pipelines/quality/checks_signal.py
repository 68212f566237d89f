"""Check the samples of a log: missing, absurd, dead, saturated, spiky, wrapped, coarse."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.io import schema
from pipelines.io.limits import ABSURD, GAP_LIMIT, percent, sentinels
from pipelines.quality.checks_subject import NotTested, Subject, many, spread
from pipelines.quality.faults import torque_limit
from pipelines.quality.segments import long_blocks

__all__ = ["SIGNAL_CHECKS"]

_FEW = 0.01  # share of samples that may be missing before a channel is not a measurement any more
_HALF = 0.5
_FAR_BEYOND = 1.5  # times its limit: a controller may command it, a wrong scale makes it everywhere


def missing_samples(s: Subject) -> list[Check]:
    """D01, D02: NaN stands for a measurement that was not made; a few are fine, a whole channel is not."""
    needed = ("q", "tau", "v") if s.log.experiment == "frf" else ("q", "tau")
    found = [check for name in s.log.signals if name in schema.SIGNALS and name not in (*needed, "t")
             for check in _missing_beside(s, name)]
    for name in needed:
        if name not in s.log:
            continue  # reading a log has refused what it cannot be without
        undefined = np.isnan(s.log[name])
        for j in np.flatnonzero(undefined.any(axis=0)).tolist():
            column, total = undefined[:, j], int(undefined[:, j].sum())
            first = int(np.argmax(column))
            blocks = long_blocks(column)
            if total > _HALF * column.size:
                words = f"{total} of {column.size} samples are missing" if total < column.size else "there is no measurement at all"
                found.append(s.say("D02", "reject",
                                   f"{name} of joint {j + 1}: {words}",
                                   signal=name, joint=j, sample=first,
                                   remedy="look at this channel's cable and its place in the recorder, and record again"))
            elif blocks:
                found.append(s.say("D02", "repair",
                                   f"{total} samples of {name} are missing, {len(blocks)} times more than "
                                   f"{GAP_LIMIT} in a row; the log is split there",
                                   signal=name, joint=j, sample=first,
                                   remedy="look at this channel's cable, and record again"))
            else:
                found.append(s.say("D01", "repair",
                                   f"{many(total, 'sample')} of {name} missing, never more than {GAP_LIMIT} in a row; "
                                   "treated as not measured",
                                   signal=name, joint=j, sample=first,
                                   remedy="none needed if they stay few"))
    return found or s.ok("D01", "no sample is missing")


def _missing_beside(s: Subject, name: str) -> list[Check]:
    """D01, D02 of a signal that fits can do without: a stage that needs it must hear of it, the others need not stop."""
    undefined = np.isnan(s.log[name])
    found = []
    for j in np.flatnonzero(undefined.any(axis=0)).tolist():
        total, first = int(undefined[:, j].sum()), int(np.argmax(undefined[:, j]))
        whole = total == len(undefined)
        words = "there is no measurement at all" if whole else f"{total} of {len(undefined)} samples are missing"
        found.append(s.say("D02" if whole else "D01", "warn", f"{name} of joint {j + 1}: {words}",
                           signal=name, joint=j, sample=first, gate=whole,
                           remedy="leave the signal out of the log, or look at this channel and record again" if whole
                           else "none needed if nothing is made of this signal"))
    return found


def absurd_samples(s: Subject) -> list[Check]:
    """D03: infinite, astronomically large, and filler values such as -999."""
    found: list[Check] = []
    for name, signal in s.log.signals.items():
        if name == "t":
            continue
        with np.errstate(invalid="ignore"):
            huge = (np.abs(signal.values) >= ABSURD) & ~np.isnan(signal.values)
        filler = sentinels(signal.values) if name in ("q", "tau") else np.zeros_like(huge)
        bad = huge | filler
        for j in np.flatnonzero(bad.any(axis=0)).tolist():
            which = np.flatnonzero(bad[:, j])
            values = ", ".join(f"{v:g}" for v in np.unique(signal.values[which[:1000], j])[:4])
            few = which.size <= _FEW * s.log.n_samples
            at = ", ".join(map(str, which[:8])) + (", …" if which.size > 8 else "")
            then = "; treated as missing" if few else ""
            found.append(s.say("D03", "repair" if few else "reject",
                               f"{many(which.size, 'sample')} of {name} with the value {values}, which is no measurement "
                               f"(samples {at}){then}",
                               signal=name, joint=j, sample=int(which[0]),
                               remedy="mark what was not measured as NaN, or look at the sensor"))
    return found or s.ok("D03", "no infinite, astronomical or filler value")


def dead_channels(s: Subject) -> list[Check]:
    """D04: what this experiment has to move does move."""
    log = s.good.log
    found = []
    reference = spread(log["q_ref"]) if "q_ref" in log else np.zeros(log.n_joints)
    torque = spread(log.tau)
    open_loop = log.experiment == "friction"  # a constant torque is what such a log is about
    for j in range(log.n_joints):
        finite = log.tau[np.isfinite(log.tau[:, j]), j]
        if not finite.size or not np.isfinite(log.q[:, j]).any():
            continue  # D02 has said so
        asked = j in s.moving or reference[j] > 0.01
        if s.travel[j] == 0.0 and asked and log.experiment != "hold":
            found.append(s.say("D04", "reject",
                               f"q of joint {j + 1} is constant ({log.q[np.isfinite(log.q[:, j]), j][0]:.6g})",
                               signal="q", joint=j,
                               remedy="look at this encoder and its place in the recorder, and record again"))
        if torque[j] == 0.0 and (j in s.moving or s.travel[j] > 0.1) and (finite[0] == 0.0 or not open_loop):
            found.append(s.say("D04", "reject",
                               f"tau of joint {j + 1} is constant ({finite[0]:.6g}) while the joint moves",
                               signal="tau", joint=j,
                               remedy="look at this channel of the recorder, and record again"))
    return found or s.ok("D04", "every channel that has to move does")


def saturation(s: Subject) -> list[Check]:
    """D05: the drive could give the torque that was asked for."""
    flags = s.good.saturated
    found = []
    for j in np.flatnonzero(flags.any(axis=0)).tolist():
        share = float(flags[:, j].mean())
        level = float(np.nanmin(np.abs(s.good.log.tau[flags[:, j], j])))
        described = torque_limit(s.log)[j]
        limit, peak = f"at the described limit of {described:.4g}", float(np.nanmax(np.abs(s.good.log.tau[flags[:, j], j])))
        if level < 0.99 * described:
            limit = f"at a flat top at {level:.4g}"
        elif peak > 1.01 * described:  # commands, which the drive cuts
            limit = f"at or beyond the described limit of {described:.4g}, up to {peak:.4g}"
        remedy = "move slower or with less acceleration; a saturated drive hides what the arm needs"
        if peak > _FAR_BEYOND * described:
            remedy += (f"; if nothing commanded {peak / described:.2g} times the limit, look for a gear ratio or torque constant "
                       "applied twice, or correct the limit in the robot's description")
        found.append(s.say("D05", "warn",
                           f"{percent(share, 2)} of the torque samples lie {limit} {s.unit('tau', j)}; "
                           "they are left out of fits",
                           signal="tau", joint=j, sample=int(s.good.kept[np.argmax(flags[:, j])]), gate=share > 0.05,
                           remedy=remedy))
    if found:
        return found
    peak = np.nanmax(np.abs(s.good.log.tau), axis=0, initial=0.0)
    return s.ok("D05", "the torque stays below its limits, at most " + s.with_units("tau", peak.tolist()), signal="tau")


def glitches(s: Subject) -> list[Check]:
    """D06: single samples far from their neighbours."""
    found = []
    for name, flags in (("q", s.good.position_spikes), ("tau", s.good.torque_spikes)):
        for j in np.flatnonzero(flags.any(axis=0)).tolist():
            which = np.flatnonzero(flags[:, j])
            found.append(s.say("D06", "repair",
                               f"{many(which.size, 'sample')} of {name} out of their neighbours as no motion does; left out",
                               signal=name, joint=j, sample=int(s.good.kept[which[0]]),
                               remedy="look at the shielding of the encoder and at the recorder's transmission"))
    return found or s.ok("D06", "no sample stands out of its neighbours")


def wraps(s: Subject) -> list[Check]:
    """D07: the position does not jump, by a turn or otherwise."""
    found, wrapped, jumped = [], np.diff(s.good.wrapped, axis=0), s.good.jumped
    for j in range(s.log.n_joints):
        unit = s.unit("q", j)
        if (at := np.flatnonzero(wrapped[:, j])).size:
            found.append(s.say("D07", "warn",
                               f"the encoder wraps {many(at.size, 'time')} by {abs(wrapped[at[0], j]):.6g} {unit}; unwrapped",
                               signal="q", joint=j, sample=int(s.good.kept[at[0] + 1]),
                               remedy="let the recorder count turns"))
        if (at := np.flatnonzero(jumped[:, j])).size:
            by = s.good.log.q[at[0], j] - s.good.log.q[at[0] - 1, j]
            found.append(s.say("D07", "warn",
                               f"the position jumps {many(at.size, 'time')}, first by {by:.4g} {unit}, "
                               "which is no turn and no counter's range; the log is split there",
                               signal="q", joint=j, sample=int(s.good.kept[at[0]]), gate=True,
                               remedy="look at the encoder: it loses counts"))
    return found or s.ok("D07", "the position neither wraps nor jumps", signal="q")


def resolution(s: Subject) -> Sequence[Check | NotTested]:
    """D08: encoders count as finely as the description says; the observer's noise is R = δ² / 12."""
    found = []
    for j, joint in enumerate(s.log.robot.joints):
        step = s.steps[j]
        if step is None:
            continue
        declared = joint.encoder_resolution
        too_coarse = step > 1.5 * declared if declared else s.travel[j] < 1000.0 * step
        if too_coarse and np.unique(s.good.log.q[np.isfinite(s.good.log.q[:, j]), j]).size >= 50:
            said = f"the description says {declared:.3g}" if declared else f"only {s.travel[j] / step:.0f} steps in all"
            found.append(s.say("D08", "warn",
                               f"the encoder counts in steps of {step:.3g} {s.unit('q', j)}, {said}; "
                               f"noise is set to R = δ²/12 = {step**2 / 12.0:.3g} {s.unit('q', j)}² from the data",
                               signal="q", joint=j,
                               remedy="correct encoder_resolution, or look for bits lost on the way"))
    hidden = [str(j + 1) for j, step in enumerate(s.steps) if step is None]
    blind = s.cannot_tell("D08", f"no step of the encoder shows in the positions of joint {', '.join(hidden)}",
                          signal="q") if hidden else []
    if found or len(hidden) == len(s.steps):
        return [*found, *blind]
    return [*s.ok("D08", f"encoder steps: {s.with_units('q', s.steps)}", signal="q"), *blind]


def identical(s: Subject) -> list[Check]:
    """S13: no two channels hold the same samples; two sensors never do."""
    alike: dict[bytes, list[tuple[str, int]]] = defaultdict(list)
    for name in ("q", "tau"):
        moving = np.flatnonzero(spread(s.log[name]) > 0).tolist() if name in s.log else []
        for j in moving:
            alike[s.log[name][:, j].tobytes()].append((name, j))
    return [s.say("S13", "warn",
                  f"{' and '.join(f'{name} of joint {j + 1}' for name, j in group)} are the same, sample for sample",
                  signal=group[-1][0], joint=group[-1][1], gate=True,
                  remedy="correct the column map of the import: one column serves two channels")
            for group in alike.values() if len(group) > 1]


SIGNAL_CHECKS = (missing_samples, absurd_samples, dead_channels, saturation, glitches, wraps, resolution, identical)
