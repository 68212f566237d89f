"""Group the modes of one joint across its postures: base, joint, delay, rigid, or open; the evidence in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.frequency.modes import Modes, Pair
from pipelines.frequency.rational import Known
from pipelines.frequency.springs import Explained, explain

__all__ = ["Finding", "GroupingConfig", "Open", "advance", "group_joint", "seen_elsewhere"]

@dataclass(frozen=True)
class GroupingConfig:
    """Numbers that decide what a mode is.

    Attributes:
        tells: χ² by which one explanation must be better: three standard deviations.
        fits: χ² per number beyond which an explanation is none: two deviations.
        heavy: rise above which what drops out outweighs the rest, (f_r/f_a)² = 1 + J_dropped/J_left: no base drops out so.
        light: of the arm's inertia: no base weighs less, or the arm would carry it.
        moves: ratio of inertias from which postures can tell base from joint: four of the frequencies' `slack` of .8 %.
        flat: a ratio of magnitudes below it is flat, 1.2 dB: half the step by a motor of a quarter of the inertia. Nothing is
            called rigid where 95 % of the frequencies are not known to as much. Sensitivity in benchmarks/README.
        span: highest over lowest frequency, two octaves, of a band in which a joint without a mode is called rigid.
        delay: of the sample time, the smallest worth a word; the hold alone makes half of one.
        sure: standard deviations of a delay.
        near: share of a frequency within which two joints show the same base.
        misfit: over the variance of noise, beyond which no mode of the fit is believed: F of many bins at 1e-6 is near 2, and
            variances from few averages are off by as much again.
        left: of the response, what a misfit may leave all the same: encoder steps that repeat are in no variance.
        trace: rise of a pair that may be only a trace of what another joint, or the base, does.
        locked: share of the frequency at which a link swings against its locked motor, within which it takes motion away.
        closed: deviations of the torque by which its mean, less friction, keeps the load on one side: a normal one is beyond for
            one sample in 44, and the describing function of a gap moves by no more.
        contact: damping ratio that teeth in contact have at least, .03 to .17 (Kasuba, Evans 1981, ASME J. Mech. Des. 103); shafts
            have .005 to .075 (Lin, Huston, Coy 1988, NASA TM-100180).
    """

    tells: float = 9.0
    fits: float = 4.0
    heavy: float = 2.0
    light: float = 0.5
    moves: float = 1.03
    flat: float = 1.15
    span: float = 4.0
    delay: float = 0.15
    sure: float = 5.0
    near: float = 0.03
    misfit: float = 10.0
    left: float = 0.02
    trace: float = 1.3
    locked: float = 0.1
    closed: float = 2.0
    contact: float = 0.03


@dataclass(frozen=True)
class Finding:
    """One thing that is sure."""

    kind: str  # "base", "joint", "rigid", "delay"
    joint: int | None  # 1-based; None: the base
    evidence: str
    cause: str | None  # as the library of causes calls it; None: nothing is wrong
    frequency: Known | None  # [Hz] of the base's resonance; of the joint's antiresonance, its motor locked
    damping: Known | None  # ratio, of the same
    parameters: Mapping[str, Known]  # as findings report them, SI
    seen_at: tuple[int, ...]  # joints
    faint: bool = False  # its pairs are so small that they may be a trace of what another joint does
    stands: tuple[Known, ...] = ()  # [Hz] of a base: the antiresonance in each posture
    frequencies: tuple[Known, ...] = ()  # [Hz] what `frequency` is in each posture


@dataclass(frozen=True)
class Open:
    """One thing that is there and could be more than one."""

    joint: int
    frequency: Known | None  # [Hz]
    candidates: tuple[str, ...]
    evidence: str
    experiment: str  # what to record to tell


def advance(modes: Sequence[Modes], sample_time: float, held: bool = True, config: GroupingConfig | None = None) -> Known | None:
    """The delay [s], where it is negative beyond doubt: no position comes before its torque."""
    mean = _late(modes, sample_time, held, config or GroupingConfig())
    return mean if mean is not None and mean.value < 0.0 else None


def group_joint(joint: int, modes: Sequence[Modes], sample_time: float, revolute: bool = True, held: bool = True,
                loads: Sequence[float] = (), config: GroupingConfig | None = None) -> tuple[list[Finding], list[Open]]:
    """What the responses of one joint (1-based), one a posture, say together.

    Args:
        sample_time: [s].
        revolute: whether it turns.
        held: whether its input is held from one sample to the next; if it was measured, nobody knows when within a sample.
        loads: mean torque less friction over its deviation, of each posture.
    """
    config = config or GroupingConfig()
    found, left = _grouped(joint, modes, sample_time, revolute, held, config)
    return _loaded(found, left, loads, config)


def _loaded(found: list[Finding], left: list[Open], loads: Sequence[float],
            config: GroupingConfig) -> tuple[list[Finding], list[Open]]:
    """A gap answers as a spring does wherever it stays closed, and on average where it is crossed (its describing function: Gelb,
    Vander Velde 1968, ch. 2): no open question leaves it out, and no spring under a steady load that is damped as teeth are."""
    left = [replace(one, candidates=(*one.candidates, "backlash"))
            if "joint_elasticity" in one.candidates and "backlash" not in one.candidates else one for one in left]
    if not loads or min(abs(load) for load in loads) < config.closed:
        return found, left
    for one in found:
        if one.kind == "joint" and one.damping is not None and one.damping.value + 2.0 * one.damping.std > config.contact:
            assert one.joint is not None
            left.append(Open(one.joint, one.frequency, ("joint_elasticity", "backlash"),
                             f"{one.evidence} But the load on the joint never changes its sign, and a damping ratio of "
                             f"{one.damping.value:.2g} is that of teeth in contact as well: a gap would stay closed.",
                             f"joint {one.joint} in a posture without load by gravity, or excited until its torque changes sign"))
    shut = {one.joint for one in left if one.candidates == ("joint_elasticity", "backlash")}
    return [one for one in found if one.kind != "joint" or one.joint not in shut], left


def _grouped(joint: int, modes: Sequence[Modes], sample_time: float, revolute: bool, held: bool,
             config: GroupingConfig) -> tuple[list[Finding], list[Open]]:
    most = max(len(m.pairs) for m in modes)
    count = min(len(_strongest(m, most)) for m in modes)
    if (worst := max((m.misfit for m in modes if m.left > config.left), default=0.0)) > config.misfit:
        return [], [Open(joint, None, ("backlash", "joint_elasticity", "base_resonance"),
                         f"No linear plant explains the response: what it leaves has {worst:.3g} times the variance of noise. "
                         "A gap that is crossed, or friction that turns its sign, does so.",
                         "another strength of excitation and a faster turn; else longer")]
    if not count and 2.0 * (left := max(m.left for m in modes)) > config.flat - 1.0:
        return [], [_scattered(joint, modes, left, config)]
    if (early := advance(modes, sample_time, held, config)) is not None:
        return [], [_early(joint, modes, early, config)]
    delays, unclear = _delay(joint, modes, sample_time, held, config)
    pairs = [_strongest(m, count) for m in modes]
    unclear += _leftover(joint, modes, count)
    found, more = _springs(joint, modes, pairs, "kg m²" if revolute else "kg", config) if count else ([], [])
    if not (found or more or delays or unclear):
        still = _rigid(joint, modes, config)
        found, more = ([still], []) if isinstance(still, Finding) else ([], [still])
    return [*found, *delays], [*more, *unclear]


def _strongest(modes: Modes, count: int) -> list[Pair]:
    """As many pairs: those that nearly cancel too, where distinct ones are fewer than in another posture."""
    several = (*modes.pairs, *modes.faint) if len(modes.pairs) < count else modes.pairs
    kept = sorted(several, key=lambda p: -p.rise)[:count]
    return sorted(kept, key=lambda p: p.antiresonance.frequency.value)


def _leftover(joint: int, modes: Sequence[Modes], count: int) -> list[Open]:
    """What one posture shows and another does not, and what has no partner."""
    extra = [p.resonance.frequency for m in modes for p in sorted(m.pairs, key=lambda p: -p.rise)[count:]]
    alone = [m.frequency for one in modes for m in one.single]
    found = []
    if extra:
        found.append(Open(joint, extra[0], ("base_resonance", "joint_elasticity", "backlash"),
                          f"A pair at {_many(extra)} Hz is seen in some postures of joint {joint} only.",
                          "the same posture again, longer or excited more strongly"))
    if alone:
        found.append(Open(joint, alone[0], ("joint_elasticity", "base_resonance", "drive_lag"),
                          f"A mode at {_many(alone)} Hz has no partner: antiresonance without resonance above it, or the reverse.",
                          "excitation to higher frequencies, and a second posture"))
    return found


def _springs(joint: int, modes: Sequence[Modes], pairs: list[list[Pair]], unit: str,
             config: GroupingConfig) -> tuple[list[Finding], list[Open]]:
    inertia, slack = [m.inertia.value if m.inertia else float("nan") for m in modes], max(m.slack for m in modes)
    if not np.isfinite(inertia).all() or min(inertia) <= 0.0:
        return [], [_open(joint, pairs, "the inertia of the joint could not be measured")]
    share = [m.inertia.std / m.inertia.value if m.inertia else 0.0 for m in modes]
    if len(pairs[0]) == 1:
        return _one_spring(joint, pairs, inertia, unit, slack, share, config)
    if len(pairs[0]) == 2:
        both = explain(pairs, inertia, True, True, slack, share)
        if both is not None and len(pairs) > 1 and _accepted(both, config) and _moves(inertia, config):
            words = (f"{_told(pairs, inertia, unit)}. A base and a spring in the joint together explain both pairs in all "
                     f"{len(pairs)} postures, within {100.0 * both.worst:.2g} %.")
            return [_as_base(both, pairs, words, joint, config), _as_joint(joint, both, pairs, inertia, words)], []
        strong = [sorted(own, key=lambda p: -p.rise) for own in pairs]
        if all(own[0].rise > config.heavy and own[1].rise < config.trace for own in strong):
            found, open_ = _one_spring(joint, [[own[0]] for own in strong], inertia, unit, slack, share, config)
            return found, [*open_, _open(joint, [[own[1]] for own in strong], "a small pair beside a large one")]
    return [], [_open(joint, pairs, f"{len(pairs[0])} pairs that no base and joint spring explain together")]


def _one_spring(joint: int, pairs: list[list[Pair]], inertia: list[float], unit: str,
                slack: float, share: Sequence[float], config: GroupingConfig) -> tuple[list[Finding], list[Open]]:
    base, spring = (explain(pairs, inertia, *which, slack, share, config.light) for which in ((True, False), (False, True)))
    assert base is not None
    assert spring is not None
    told = _told(pairs, inertia, unit)
    rise = float(np.mean([own[0].rise for own in pairs]))
    assert base.base is not None
    if spring.misfit > base.misfit + config.tells and _accepted(base, config):
        words = (f"{told}. The resonance stays where it is while the inertia changes, with a phase lead between the two: a base of "
                 f"{base.base[1]:.3g} {unit} explains every frequency within {100.0 * base.worst:.2g} %, a spring in the "
                 f"joint {_within(spring)}.")
        return [_as_base(base, pairs, words, joint, config)], []
    if base.misfit > spring.misfit + config.tells and _accepted(spring, config):
        assert spring.joint is not None
        words = (f"{told}. The antiresonance moves with the posture as a link on a spring does. The level above the resonance is "
                 f"{rise:.3g} times that below: 1/J of a motor of {spring.joint[1]:.3g} {unit}. A spring in the joint explains "
                 f"every frequency within {100.0 * spring.worst:.2g} %, a base {_within(base)}.")
        return [_as_joint(joint, spring, pairs, inertia, words)], []
    if _accepted(spring, config) and all(own[0].rise > config.heavy for own in pairs):
        assert spring.joint is not None
        words = (f"{told}. The postures do not tell base and joint apart, but the level above the resonance is {rise:.3g} times "
                 f"that below: what drops out there outweighs the rest, {spring.joint[1]:.3g} {unit}. That is a link behind a "
                 "spring, not a base lighter than its arm.")
        return [_as_joint(joint, spring, pairs, inertia, words)], []
    why = "one posture only" if len(pairs) == 1 else \
        "the inertia hardly differs between the postures" if not _moves(inertia, config) \
        else f"a base explains it {_within(base)}, a spring in the joint {_within(spring)}"
    return [], [_open(joint, pairs, f"{told}; {why}")]


def _within(one: Explained) -> str:
    return f"within {100.0 * one.worst:.2g} %" if one.worst < 1.0 else "not at all"


def _accepted(one: Explained, config: GroupingConfig) -> bool:
    return one.misfit <= config.tells + config.fits * one.freedom


def _moves(inertia: Sequence[float], config: GroupingConfig) -> bool:
    """Return whether postures differ enough in inertia to tell by."""
    return max(inertia) > config.moves * min(inertia)


def _as_base(one: Explained, pairs: list[list[Pair]], words: str, joint: int, config: GroupingConfig) -> Finding:
    assert one.base is not None
    frequency, inertia = (Known(v, v * s) for v, s in zip(one.base, one.std[:2], strict=True))
    near = [min(own, key=lambda p: abs(p.resonance.frequency.value - frequency.value)) for own in pairs]
    each = tuple(p.resonance.frequency for p in near)
    measured, damping = _mean(each), _mean([p.resonance.damping for p in near])
    numbers = {"frequency": measured, "damping_ratio": damping, "inertia": inertia}
    return Finding("base", None, words, "base_resonance", measured, damping, numbers, (joint,),
                   max(p.rise for p in near) < config.trace, tuple(p.antiresonance.frequency for p in near), each)


def _as_joint(joint: int, one: Explained, pairs: list[list[Pair]], inertia: list[float], words: str) -> Finding:
    assert one.joint is not None
    stiffness, motor = (Known(v, v * s) for v, s in zip(one.joint, one.std[-2:], strict=True))
    link = np.array(inertia) - motor.value
    locked = np.sqrt(stiffness.value / link) / (2.0 * np.pi)
    near = [min(own, key=lambda p: abs(p.antiresonance.frequency.value - f)) for own, f in zip(pairs, locked, strict=True)]
    damping = _mean([p.antiresonance.damping for p in near])
    d = [2.0 * p.antiresonance.damping.value * np.sqrt(stiffness.value * j) for p, j in zip(near, link, strict=True)]
    value, mean_link = float(np.mean(d)), float(np.mean(link))
    # d = 2 ζ √(k (J - J_m)): what is known of k and J_m is in d as well.
    slope = value * np.array([1.0 / max(abs(damping.value), 1e-9), 0.5, -0.5 * motor.value / mean_link])
    known = np.zeros((3, 3))
    known[0, 0], known[1:, 1:] = damping.std**2, one.covariance[-2:, -2:]  # of ζ, log k, log J_m
    std = float(np.sqrt(slope @ known @ slope))
    frequency = float(np.sqrt(stiffness.value / mean_link) / (2.0 * np.pi))
    each = tuple(p.antiresonance.frequency for p in near)
    scatter = float(np.std([v.value for v in each]))  # it moves with the posture: one number stands for all of them
    return Finding("joint", joint, words, "joint_elasticity",
                   Known(frequency, float(np.hypot(scatter, frequency * max(v.std / v.value for v in each)))),
                   damping, {"stiffness": stiffness, "damping": Known(value, std),
                             "frequency": Known(frequency, float(np.hypot(scatter, 0.5 * frequency * one.std[-2]))),
                             "motor_inertia": motor}, (joint,), frequencies=each)


def _mean(values: Sequence[Known]) -> Known:
    """Weighted with 1/std²; its deviation holds what the values scatter, too."""
    weight = np.array([1.0 / max(v.std, 1e-12) ** 2 for v in values])
    if not weight.sum() > 0.0:
        return Known(float(np.mean([v.value for v in values])), np.inf)  # nothing of it is known
    mean = float(weight @ [v.value for v in values] / weight.sum())
    scatter = float(weight @ [(v.value - mean) ** 2 for v in values]) / max(len(values) - 1, 1)
    return Known(mean, float(np.sqrt(max(scatter, 1.0) / weight.sum())))


def _late(modes: Sequence[Modes], sample_time: float, held: bool, config: GroupingConfig) -> Known | None:
    """The delay [s], where there is one, of either sign."""
    mean = _mean([m.delay for m in modes])
    least = (config.delay if held else 1.0) * sample_time
    return mean if np.isfinite(mean.value) and abs(mean.value) >= max(least, config.sure * mean.std) else None


def _early(joint: int, modes: Sequence[Modes], early: Known, config: GroupingConfig) -> Open:
    flat = max(m.flat for m in modes)
    other = "" if flat < config.flat else f", or a mode outside the excited band: the magnitude changes by a factor of {flat:.3g}"
    return Open(joint, None, () if flat < config.flat else ("joint_elasticity", "base_resonance"),
                f"The phase advances as with {-1e3 * early.value:.3g} ms of time gained. No lag does that: faster motion has "
                f"folded back (aliasing), or torque and position have different clocks{other}.",
                "all signals by one clock, at the controller's own rate")


def _delay(joint: int, modes: Sequence[Modes], sample_time: float, held: bool,
           config: GroupingConfig) -> tuple[list[Finding], list[Open]]:
    mean = _late(modes, sample_time, held, config)
    if mean is None:
        return [], []
    each = f"{1e3 * mean.value:.3g} ± {2e3 * mean.std:.2g}"
    flat = max(m.flat for m in modes)
    if flat < config.flat:
        words = (f"Beside its modes the magnitude is flat within {100.0 * (flat - 1.0):.2g} % and the phase falls in proportion to "
                 f"the frequency: position comes {each} ms late in {_postures(modes)}, beyond hold and controller.")
        return [Finding("delay", joint, words, "time_delay", None, None, {"delay": mean}, (joint,))], []
    return [], [Open(joint, None, ("drive_lag", "time_delay", "torque_lag"),
                     f"The phase falls as with {each} ms of delay, but the magnitude is not flat: a factor of {flat:.3g}.",
                     "the measured motor current beside the command")]


def _in_all(modes: Sequence[Modes], config: GroupingConfig) -> list[Known]:
    """Resonances of pairs that nearly cancel, at the same frequency in every posture: one alone is as likely noise."""
    each = [[m.frequency for m in one.traces if m.kind == "resonance"] for one in modes]
    return [first for first in each[0] if all(any(_same(first, one, config) for one in own) for own in each[1:])]


def _scattered(joint: int, modes: Sequence[Modes], left: float, config: GroupingConfig) -> Open:
    low, high = max(m.band[0] for m in modes), min(m.band[1] for m in modes)
    return Open(joint, None, ("backlash", "joint_elasticity", "base_resonance"),
                f"No mode is distinct from {low:.3g} to {high:.3g} Hz, but the response scatters by {100.0 * left:.2g} % about "
                f"a linear plant's: whether it is flat within {100.0 * (config.flat - 1.0):.2g} %, or late, is not known. Noise "
                "does so, and a gap that is crossed.", "longer, and excited more strongly")


def _rigid(joint: int, modes: Sequence[Modes], config: GroupingConfig) -> Finding | Open:
    flat, low, high = max(m.flat for m in modes), max(m.band[0] for m in modes), min(m.band[1] for m in modes)
    if high < config.span * low:
        return Open(joint, None, ("joint_elasticity", "base_resonance"),
                    f"No mode is distinct from {low:.3g} to {high:.3g} Hz; more than that the excitation does not tell.",
                    "stronger excitation, to lower and higher frequencies")
    if flat < config.flat:
        traces = _in_all(modes, config) if len(modes) > 1 else []
        beside = f" Pairs that nearly cancel recur at {_many(traces)} Hz: of a base, or of another joint." if traces else ""
        words = (f"No {'distinct ' if traces else ''}mode from {low:.3g} to {high:.3g} Hz in {_postures(modes)}: the acceleration "
                 f"per input is flat within {100.0 * (flat - 1.0):.2g} %, without delay.{beside}")
        return Finding("rigid", joint, words, None, None, None, {}, (joint,))
    return Open(joint, None, ("drive_lag", "joint_elasticity", "backlash"),
                f"No mode is distinct, yet the acceleration per input changes by a factor of {flat:.3g}.",
                "longer, with stronger excitation, and in a second posture")


def _open(joint: int, pairs: list[list[Pair]], why: str) -> Open:
    first = min((p for own in pairs for p in own), key=lambda p: p.resonance.frequency.value)
    return Open(joint, first.resonance.frequency, ("base_resonance", "joint_elasticity"),
                f"{why[0].upper()}{why[1:]}.",
                f"joint {joint} in a further posture of the other joints that changes its inertia by a tenth or more")


def _told(pairs: list[list[Pair]], inertia: Sequence[float], unit: str) -> str:
    low = [p.antiresonance.frequency for own in pairs for p in own]
    high = [p.resonance.frequency for own in pairs for p in own]
    moved = ", ".join(f"{j:.3g}" for j in inertia)
    return f"Antiresonance at {_many(low)} Hz, resonance at {_many(high)} Hz, with {moved} {unit} at the joint"


def _postures(modes: Sequence[Modes]) -> str:
    return "one posture" if len(modes) == 1 else f"{len(modes)} postures"


def _many(values: Sequence[Known]) -> str:
    return ", ".join(f"{v.value:.4g}" for v in values)


def seen_elsewhere(sure: Sequence[Finding], unsure: Sequence[Open],
                   config: GroupingConfig | None = None) -> tuple[tuple[Finding, ...], tuple[Open, ...]]:
    """Where the base is known, what other joints show at its frequency is the base as well.

    A base turns under the first joint before any other. What shows at one further joint alone, while another bends on a spring, may
    be that spring, where it is faint or stands still where that spring would make it: its link swings against a motor that its own
    controller, or friction, holds, and takes the motion away (a tuned absorber: Den Hartog 1934, chapter III).
    """
    config = config or GroupingConfig()
    rest = [one for one in sure if one.kind != "base"]
    bent = [one for one in rest if one.kind == "joint"]
    bases = [one for one in sure if one.kind == "base"]
    merged: list[Finding] = []
    for one in bases:
        same = next((k for k, m in enumerate(merged) if _same(m.frequency, one.frequency, config)), None)
        if same is None:
            merged.append(one)
        else:
            both = merged[same]
            merged[same] = replace(both, seen_at=(*both.seen_at, *one.seen_at), faint=both.faint and one.faint)
    left = []
    for one in [one for one in merged if len(one.seen_at) == 1 and one.seen_at != (1,)]:
        others = [other for other in bent if other.joint != one.seen_at[0]]  # at its own joint a spring has a pair of its own
        springs = [*(other for other in others if _absorbed(one, other, config)), *(others if one.faint else ())]
        if springs:
            merged.remove(one)
            left.append(_trace(one, springs[0]))
    for question in unsure:
        place = next((k for k, m in enumerate(merged) if "base_resonance" in question.candidates
                      and _same(m.frequency, question.frequency, config)), None)
        if place is None:
            left.append(question)
        elif question.joint not in merged[place].seen_at:
            merged[place] = replace(merged[place], seen_at=(*merged[place].seen_at, question.joint))
    return (*merged, *rest), tuple(left)


def _absorbed(base: Finding, spring: Finding, config: GroupingConfig) -> bool:
    """Return whether all that stands still for the base does so where the link behind the spring would swing."""
    own = spring.frequency
    return own is not None and bool(base.stands) and \
        all(abs(one.value - own.value) < config.locked * own.value for one in base.stands)


def _trace(base: Finding, spring: Finding) -> Open:
    joint = base.seen_at[0]
    return Open(joint, base.frequency, ("base_resonance", "joint_elasticity"),
                f"{base.evidence} But {'the pair is small, ' if base.faint else ''}it is sure at this joint alone, and it may be a "
                f"trace of joint {spring.joint}, which bends.",
                f"joint {spring.joint} made firm, or its brake closed, then joint {joint} again")


def _same(a: Known | None, b: Known | None, config: GroupingConfig) -> bool:
    return a is not None and b is not None and abs(a.value - b.value) < config.near * a.value
