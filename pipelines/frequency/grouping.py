"""Group the modes of one joint across its postures: base, joint, delay, rigid, or open.

Every answer has its evidence in words and numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.frequency.config import GroupingConfig
from pipelines.frequency.modes import Modes, Pair
from pipelines.frequency.rational import Known
from pipelines.frequency.springs import Explained, explain
from pipelines.io.results import NOT_STORED

__all__ = ["Finding", "Open", "advance", "group_joint", "seen_elsewhere"]

_BASE, _JOINT = "base_resonance", "joint_elasticity"


@dataclass(frozen=True)
class Finding:
    """A cause that is sure."""

    kind: str  # "base", "joint", "rigid", "delay"
    joint: int | None  # 1-based; None: the base
    evidence: str
    cause: str | None = None  # as the library of causes calls it; None: nothing is wrong
    frequency: Known | None = None  # [Hz] of the base's resonance; of the joint's antiresonance
    damping: Known | None = None  # ratio, of the same
    parameters: Mapping[str, Known] = field(default_factory=dict)  # SI
    seen_at: tuple[int, ...] = ()  # joints
    # its pairs are so small that they may be a trace of what another joint does
    faint: bool = field(default=False, metadata=NOT_STORED)
    # [Hz] of a base: the antiresonance in each posture
    stands: tuple[Known, ...] = field(default=(), metadata=NOT_STORED)
    frequencies: tuple[Known, ...] = ()  # [Hz] `frequency` in each posture


@dataclass(frozen=True)
class Open:
    """An observation with more than one possible cause."""

    joint: int
    frequency: Known | None  # [Hz]
    candidates: tuple[str, ...]
    evidence: str
    experiment: str  # what to record to tell


Grouped = tuple[list[Finding], list[Open]]


@dataclass(frozen=True)
class _Joint:
    """One joint in all its postures."""

    number: int
    modes: Sequence[Modes]
    sample_time: float
    unit: str  # of the inertia
    held: bool
    config: GroupingConfig

    def open(self, frequency: Known | None, candidates: Sequence[str], why: str, ask: str) -> Open:
        """Return a question about this joint."""
        return Open(self.number, frequency, tuple(candidates), why, ask)

    @property
    def inertia(self) -> list[float]:
        """Of each posture [kg m^2]."""
        return [m.inertia.value if m.inertia else np.nan for m in self.modes]

    @property
    def postures(self) -> str:
        """How many there are, in words."""
        return "one posture" if len(self.modes) == 1 else f"{len(self.modes)} postures"

    @property
    def band(self) -> tuple[float, float]:
        """[Hz] that all postures tell."""
        return max(m.band[0] for m in self.modes), min(m.band[1] for m in self.modes)

    @property
    def flat(self) -> float:
        """Ratio by which the magnitude changes beside the modes, at most."""
        return max(m.flat for m in self.modes)


def advance(
    modes: Sequence[Modes],
    sample_time: float,
    held: bool = True,
    config: GroupingConfig | None = None,
) -> Known | None:
    """Return the delay [s], where it is negative beyond doubt: position leads its torque."""
    mean = _late(modes, sample_time, held, config or GroupingConfig())
    return mean if mean is not None and mean.value < 0.0 else None


def group_joint(
    joint: int,
    modes: Sequence[Modes],
    sample_time: float,
    revolute: bool = True,
    held: bool = True,
    loads: Sequence[float] = (),
    config: GroupingConfig | None = None,
) -> Grouped:
    """Return what the responses of one joint (1-based), one a posture, say together.

    Args:
        joint: 1-based.
        modes: of each posture.
        sample_time: [s].
        revolute: whether it turns.
        held: whether its input is held over a sample; else the instant is unknown.
        loads: mean torque less friction over its deviation, of each posture.
        config: what decides.

    A gap answers as a spring does as long as it stays closed, and on average where it is crossed
    (its describing function: Gelb, Vander Velde 1968, ch. 2): no open question leaves it out, and
    no spring under a steady load that is damped as teeth are.
    """
    config = config or GroupingConfig()
    unit = "kg m²" if revolute else "kg"
    found, left = _grouped(_Joint(joint, modes, sample_time, unit, held, config))
    left = [
        replace(one, candidates=(*one.candidates, "backlash"))
        if _JOINT in one.candidates and "backlash" not in one.candidates
        else one
        for one in left
    ]
    if not loads or min(abs(load) for load in loads) < config.closed:
        return found, left
    sure = []
    for one in found:
        d = one.damping
        if one.kind != "joint" or d is None or d.value + 2.0 * d.std <= config.contact:
            sure.append(one)
            continue
        words = (
            f"{one.evidence} But the load on the joint never changes its sign, and a damping ratio "
            f"of {d.value:.2g} is that of teeth in contact as well: a gap would stay closed."
        )
        ask = (
            f"joint {joint} in a posture without load by gravity, or excited until its torque "
            "changes sign"
        )
        left.append(Open(joint, one.frequency, (_JOINT, "backlash"), words, ask))
    return sure, left


def _grouped(own: _Joint) -> Grouped:
    modes, config = own.modes, own.config
    worst = max((m.misfit for m in modes if m.left > config.left), default=0.0)
    if worst > config.misfit:
        words = (
            f"No linear plant explains the response: what it leaves has {worst:.3g} times the "
            "variance of noise. A gap that is crossed, or friction that turns its sign, does so."
        )
        ask = "another strength of excitation and a faster turn; else longer"
        return [], [own.open(None, ("backlash", _JOINT, _BASE), words, ask)]
    most = max(len(m.pairs) for m in modes)
    count = min(len(_strongest(m, most)) for m in modes)
    left, (low, high) = max(m.left for m in modes), own.band
    if not count and 2.0 * left > config.flat - 1.0:
        words = (
            f"No mode is distinct from {low:.3g} to {high:.3g} Hz, but the response scatters by "
            f"{100.0 * left:.2g} % about a linear plant's: whether it is flat within "
            f"{100.0 * (config.flat - 1.0):.2g} %, or late, is not known. Noise does so, and a gap "
            "that is crossed."
        )
        ask = "longer, and excited more strongly"
        return [], [own.open(None, ("backlash", _JOINT, _BASE), words, ask)]
    late = _late(modes, own.sample_time, own.held, config)
    if late is not None and late.value < 0.0:
        return [], [_early(own, late)]
    delays, unclear = ([], []) if late is None else _delay(own, late)
    unclear += _leftover(own, count)
    pairs = [_strongest(m, count) for m in modes]
    found, more = _springs(own, pairs) if count else ([], [])
    if not (found or more or delays or unclear):
        found, more = _rigid(own)
    return [*found, *delays], [*more, *unclear]


def _strongest(modes: Modes, count: int) -> list[Pair]:
    """As many pairs: those that nearly cancel too, where distinct ones are fewer than elsewhere."""
    several = (*modes.pairs, *modes.faint) if len(modes.pairs) < count else modes.pairs
    kept = sorted(several, key=lambda p: -p.rise)[:count]
    return sorted(kept, key=lambda p: p.antiresonance.frequency.value)


def _leftover(own: _Joint, count: int) -> list[Open]:
    """Modes that only some postures show, or that have no partner."""
    found = []
    by_rise = [sorted(m.pairs, key=lambda p: -p.rise)[count:] for m in own.modes]
    if extra := [p.resonance.frequency for rest in by_rise for p in rest]:
        words = f"A pair at {_many(extra)} Hz is seen in some postures of joint {own.number} only."
        ask = "the same posture again, longer or excited more strongly"
        found.append(own.open(extra[0], (_BASE, _JOINT, "backlash"), words, ask))
    if alone := [m.frequency for one in own.modes for m in one.single]:
        words = (
            f"A mode at {_many(alone)} Hz has no partner: antiresonance without resonance above "
            "it, or the reverse."
        )
        ask = "excitation to higher frequencies, and a second posture"
        found.append(own.open(alone[0], (_JOINT, _BASE, "drive_lag"), words, ask))
    return found


def _springs(own: _Joint, pairs: list[list[Pair]]) -> Grouped:
    config = own.config
    if not np.isfinite(own.inertia).all() or min(own.inertia) <= 0.0:
        return [], [_which(own, pairs, "the inertia of the joint could not be measured")]
    if len(pairs[0]) == 1:
        return _one_spring(own, pairs)
    base_and_joint = 2
    if len(pairs[0]) == base_and_joint:
        both = _explained(own, pairs, (True, True))
        if both is not None and len(pairs) > 1 and _accepted(both, config) and _moves(own):
            words = (
                f"{_told(own, pairs)}. A base and a spring in the joint together explain both "
                f"pairs in all {len(pairs)} postures, within {100.0 * both.worst:.2g} %."
            )
            return [_as_base(own, both, pairs, words), _as_joint(own, both, pairs, words)], []
        strong = [sorted(one, key=lambda p: -p.rise) for one in pairs]
        if all(a.rise > config.heavy and b.rise < config.trace for a, b in strong):
            found, left = _one_spring(own, [one[:1] for one in strong])
            weak = [one[1:] for one in strong]
            return found, [*left, _which(own, weak, "a small pair beside a large one")]
    words = f"{len(pairs[0])} pairs that no base and joint spring explain together"
    return [], [_which(own, pairs, words)]


def _one_spring(own: _Joint, pairs: list[list[Pair]]) -> Grouped:
    config, told = own.config, _told(own, pairs)
    base = _explained(own, pairs, (True, False))
    spring = _explained(own, pairs, (False, True))
    if base is None or spring is None or base.base is None or spring.joint is None:
        raise AssertionError("one pair a posture is one spring's")
    rise = float(np.mean([one[0].rise for one in pairs]))
    higher = f"the level above the resonance is {rise:.3g} times that below"
    if spring.misfit > base.misfit + config.tells and _accepted(base, config):
        words = (
            f"{told}. The resonance stays where it is while the inertia changes, with a phase lead "
            f"between the two: a base of {base.base[1]:.3g} {own.unit} explains every frequency "
            f"within {100.0 * base.worst:.2g} %, a spring in the joint {_within(spring)}."
        )
        return [_as_base(own, base, pairs, words)], []
    if base.misfit > spring.misfit + config.tells and _accepted(spring, config):
        words = (
            f"{told}. The antiresonance moves with the posture as a link on a spring does. "
            f"T{higher[1:]}: 1/J of a motor of {spring.joint[1]:.3g} {own.unit}. A spring in the "
            f"joint explains every frequency within {100.0 * spring.worst:.2g} %, a base "
            f"{_within(base)}."
        )
        return [_as_joint(own, spring, pairs, words)], []
    if _accepted(spring, config) and all(one[0].rise > config.heavy for one in pairs):
        words = (
            f"{told}. The postures do not tell base and joint apart, but {higher}: what drops out "
            f"there outweighs the rest, {spring.joint[1]:.3g} {own.unit}. That is a link behind a "
            "spring, not a base lighter than its arm."
        )
        return [_as_joint(own, spring, pairs, words)], []
    why = f"a base explains it {_within(base)}, a spring in the joint {_within(spring)}"
    if len(pairs) == 1:
        why = "one posture only"
    elif not _moves(own):
        why = "the inertia hardly differs between the postures"
    return [], [_which(own, pairs, f"{told}; {why}")]


def _explained(
    own: _Joint, pairs: list[list[Pair]], springs: tuple[bool, bool]
) -> Explained | None:
    slack = max(m.slack for m in own.modes)
    share = [m.inertia.std / m.inertia.value if m.inertia else 0.0 for m in own.modes]
    return explain(pairs, own.inertia, springs, slack, share, own.config.light)


def _within(one: Explained) -> str:
    return f"within {100.0 * one.worst:.2g} %" if one.worst < 1.0 else "not at all"


def _accepted(one: Explained, config: GroupingConfig) -> bool:
    return one.misfit <= config.tells + config.fits * one.freedom


def _moves(own: _Joint) -> bool:
    """Return whether postures differ enough in inertia to tell by."""
    return max(own.inertia) > own.config.moves * min(own.inertia)


def _as_base(own: _Joint, one: Explained, pairs: list[list[Pair]], words: str) -> Finding:
    frequency, inertia = one.base or (np.nan, np.nan)

    def off(pair: Pair) -> float:
        return abs(pair.resonance.frequency.value - frequency)

    near = [min(several, key=off) for several in pairs]
    each = tuple(p.resonance.frequency for p in near)
    measured, damping = _mean(each), _mean([p.resonance.damping for p in near])
    known = Known(inertia, inertia * one.std[1])
    return Finding(
        kind="base",
        joint=None,
        evidence=words,
        cause=_BASE,
        frequency=measured,
        damping=damping,
        parameters={"frequency": measured, "damping_ratio": damping, "inertia": known},
        seen_at=(own.number,),
        faint=max(p.rise for p in near) < own.config.trace,
        stands=tuple(p.antiresonance.frequency for p in near),
        frequencies=each,
    )


def _as_joint(own: _Joint, one: Explained, pairs: list[list[Pair]], words: str) -> Finding:
    k, motor = one.joint or (np.nan, np.nan)
    link = np.array(own.inertia) - motor
    locked = np.sqrt(k / link) / (2.0 * np.pi)
    near = []
    for several, f in zip(pairs, locked.tolist(), strict=True):
        off = [abs(p.antiresonance.frequency.value - f) for p in several]
        near.append(several[off.index(min(off))])
    damping = _mean([p.antiresonance.damping for p in near])
    each = tuple(p.antiresonance.frequency for p in near)
    # d = 2 ζ √(k (J - J_m)): what is known of k and J_m is in d as well.
    ratios, mean_link = [p.antiresonance.damping.value for p in near], float(np.mean(link))
    d = float(np.mean(2.0 * np.array(ratios) * np.sqrt(k * link)))
    slope = d * np.array([1.0 / max(abs(damping.value), 1e-9), 0.5, -0.5 * motor / mean_link])
    known = np.zeros((3, 3))
    known[0, 0], known[1:, 1:] = damping.std**2, one.covariance[-2:, -2:]  # ζ, log k, log J_m
    frequency = float(np.sqrt(k / mean_link) / (2.0 * np.pi))
    # it moves with the posture: one number stands for all of them
    scatter = float(np.std([v.value for v in each]))
    measured = frequency * max(v.std / v.value for v in each)
    fitted = 0.5 * frequency * one.std[-2]
    return Finding(
        kind="joint",
        joint=own.number,
        evidence=words,
        cause=_JOINT,
        frequency=Known(frequency, float(np.hypot(scatter, measured))),
        damping=damping,
        parameters={
            "stiffness": Known(k, k * one.std[-2]),
            "damping": Known(d, float(np.sqrt(slope @ known @ slope))),
            "frequency": Known(frequency, float(np.hypot(scatter, fitted))),
            "motor_inertia": Known(motor, motor * one.std[-1]),
        },
        seen_at=(own.number,),
        frequencies=each,
    )


def _mean(values: Sequence[Known]) -> Known:
    """Weighted with 1/std²; its deviation holds what the values scatter, too."""
    own = np.array([v.value for v in values])
    weight = 1.0 / np.maximum([v.std for v in values], 1e-12) ** 2
    if not weight.sum() > 0.0:
        return Known(float(own.mean()), np.inf)  # nothing of it is known
    mean = float(weight @ own / weight.sum())
    scatter = float(weight @ (own - mean) ** 2) / max(len(values) - 1, 1)
    return Known(mean, float(np.sqrt(max(scatter, 1.0) / weight.sum())))


def _late(
    modes: Sequence[Modes], sample_time: float, held: bool, config: GroupingConfig
) -> Known | None:
    """Return the delay [s], where there is one, of either sign."""
    mean = _mean([m.delay for m in modes])
    least = max((config.delay if held else 1.0) * sample_time, config.sure * mean.std)
    return mean if np.isfinite(mean.value) and abs(mean.value) >= least else None


def _early(own: _Joint, early: Known) -> Open:
    other, candidates = "", tuple[str, ...]()
    if own.flat >= own.config.flat:
        candidates = (_JOINT, _BASE)
        other = ", or a mode outside the excited band: the magnitude changes by a factor of "
        other += f"{own.flat:.3g}"
    words = (
        f"The phase advances as with {-1e3 * early.value:.3g} ms of time gained. No lag does that: "
        "faster motion has folded back (aliasing), or torque and position have different clocks"
        f"{other}."
    )
    ask = "all signals by one clock, at the controller's own rate"
    return own.open(None, candidates, words, ask)


def _delay(own: _Joint, late: Known) -> Grouped:
    each = f"{1e3 * late.value:.3g} ± {2e3 * late.std:.2g}"
    if own.flat < own.config.flat:
        words = (
            f"Beside its modes the magnitude is flat within {100.0 * (own.flat - 1.0):.2g} % and "
            f"the phase falls in proportion to the frequency: position comes {each} ms late in "
            f"{own.postures}, beyond hold and controller."
        )
        seen, told = (own.number,), {"delay": late}
        found = Finding("delay", own.number, words, "time_delay", parameters=told, seen_at=seen)
        return [found], []
    words = (
        f"The phase falls as with {each} ms of delay, but the magnitude is not flat: a factor of "
        f"{own.flat:.3g}."
    )
    ask = "the measured motor current beside the command"
    return [], [own.open(None, ("drive_lag", "time_delay", "torque_lag"), words, ask)]


def _rigid(own: _Joint) -> Grouped:
    config, (low, high) = own.config, own.band
    if high < config.span * low:
        words = (
            f"No mode is distinct from {low:.3g} to {high:.3g} Hz; more than that the excitation "
            "does not tell."
        )
        ask = "stronger excitation, to lower and higher frequencies"
        return [], [own.open(None, (_JOINT, _BASE), words, ask)]
    if own.flat >= config.flat:
        words = (
            "No mode is distinct, yet the acceleration per input changes by a factor of "
            f"{own.flat:.3g}."
        )
        ask = "longer, with stronger excitation, and in a second posture"
        return [], [own.open(None, ("drive_lag", _JOINT, "backlash"), words, ask)]
    # pairs that nearly cancel, the same in every posture: one alone is as likely noise
    each = [[m.frequency for m in one.traces if m.kind == "resonance"] for one in own.modes]
    traces = [
        first
        for first in (each[0] if len(each) > 1 else [])
        if all(any(_same(first, one, config) for one in rest) for rest in each[1:])
    ]
    kind, beside = "mode", ""
    if traces:
        kind = "distinct mode"
        beside = f" Pairs that nearly cancel recur at {_many(traces)} Hz: of a base, or of another "
        beside += "joint."
    words = (
        f"No {kind} from {low:.3g} to {high:.3g} Hz in {own.postures}: the acceleration per input "
        f"is flat within {100.0 * (own.flat - 1.0):.2g} %, without delay.{beside}"
    )
    return [Finding("rigid", own.number, words, seen_at=(own.number,))], []


def _which(own: _Joint, pairs: list[list[Pair]], why: str) -> Open:
    """Ask whether base or joint is compliant."""
    first = min((p.resonance.frequency for one in pairs for p in one), key=lambda f: f.value)
    ask = f"joint {own.number} in a further posture of the other joints that changes its inertia "
    words = f"{why[0].upper()}{why[1:]}."
    return own.open(first, (_BASE, _JOINT), words, f"{ask}by a tenth or more")


def _told(own: _Joint, pairs: list[list[Pair]]) -> str:
    low = [p.antiresonance.frequency for one in pairs for p in one]
    high = [p.resonance.frequency for one in pairs for p in one]
    moved = ", ".join(f"{j:.3g}" for j in own.inertia)
    seen = f"Antiresonance at {_many(low)} Hz, resonance at {_many(high)} Hz"
    return f"{seen}, with {moved} {own.unit} at the joint"


def _many(values: Sequence[Known]) -> str:
    return ", ".join(f"{v.value:.4g}" for v in values)


def seen_elsewhere(
    sure: Sequence[Finding], unsure: Sequence[Open], config: GroupingConfig | None = None
) -> tuple[tuple[Finding, ...], tuple[Open, ...]]:
    """Where the base is known, what other joints show at its frequency is the base as well.

    A base turns under the first joint before any other. What shows at one further joint alone,
    while another bends on a spring, may be that spring, where it is faint or stands still where
    that spring would make it: its link swings against a motor that its own controller, or friction,
    holds, and takes the motion away (a tuned absorber: Den Hartog 1934, chapter III).
    """
    config = config or GroupingConfig()
    rest = [one for one in sure if one.kind != "base"]
    merged: list[Finding] = []
    for one in (one for one in sure if one.kind == "base"):
        at = _place(merged, one.frequency, config)
        if at is None:
            merged.append(one)
            continue
        seen_at = (*merged[at].seen_at, *one.seen_at)
        merged[at] = replace(merged[at], seen_at=seen_at, faint=merged[at].faint and one.faint)
    left = []
    for one in [one for one in merged if len(one.seen_at) == 1 and one.seen_at != (1,)]:
        # at its own joint a spring has a pair of its own
        bent = [b for b in rest if b.kind == "joint" and b.joint != one.seen_at[0]]
        springs = [b for b in bent if _absorbed(one, b, config)] or (bent if one.faint else [])
        if springs:
            merged.remove(one)
            left.append(_trace(one, springs[0]))
    for question in unsure:
        at = _place(merged, question.frequency, config) if _BASE in question.candidates else None
        if at is None:
            left.append(question)
        elif question.joint not in merged[at].seen_at:
            merged[at] = replace(merged[at], seen_at=(*merged[at].seen_at, question.joint))
    return (*merged, *rest), tuple(left)


def _place(bases: list[Finding], frequency: Known | None, config: GroupingConfig) -> int | None:
    """Place of the base at this frequency."""
    same = (k for k, one in enumerate(bases) if _same(one.frequency, frequency, config))
    return next(same, None)


def _absorbed(base: Finding, spring: Finding, config: GroupingConfig) -> bool:
    """Return whether all that stands still for the base does so where the spring's link swings."""
    own = spring.frequency
    if own is None or not base.stands:
        return False
    return all(abs(one.value - own.value) < config.locked * own.value for one in base.stands)


def _trace(base: Finding, spring: Finding) -> Open:
    joint = base.seen_at[0]
    words = (
        f"{base.evidence} But {'the pair is small, ' if base.faint else ''}it is sure at this "
        f"joint alone, and it may be a trace of joint {spring.joint}, which bends."
    )
    ask = f"joint {spring.joint} made firm, or its brake closed, then joint {joint} again"
    return Open(joint, base.frequency, (_BASE, _JOINT), words, ask)


def _same(a: Known | None, b: Known | None, config: GroupingConfig) -> bool:
    return a is not None and b is not None and abs(a.value - b.value) < config.near * a.value
