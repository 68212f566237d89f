"""Name what the responses of a joint show in its postures: base, joint, delay, rigid, or open.

Every answer has its evidence in words and numbers. A base shows at the same frequency in every
posture, with a phase lead; what bends in the arm moves with the posture (Kostić et al. 2004,
Section IV.D). A pair of modes is explained by masses and springs of either kind with the inertia
measured in each posture:

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ (J - J_m)(ẋ + q̇ + ẇ)²,    V = ½ I ω_b² x² + ½ k w²

x turns the base, q is what encoder and torque act on, w the twist of the joint; J is the joint's
inertia in a posture, the other joints held. Resonances are the modes under no torque,
antiresonances those with q locked (Spong 1987, ASME J. Dyn. Syst. 109, p. 310, for the joint).

    base alone       f_r = f_b in every posture,   f_a = f_b √(I / (I + J))
                     A rotor behind a gear turns N times as fast as the joint, and hardly feels the
                     base: of J = J_l + J_m the base carries J_l,  K = I ω_b²,
                     ω_a² = K / (I + J_l),  ω_r² = K / (I + J_l J_m / J); J_m = 0 if it rides along
    joint alone      f_a = √(k / (J - J_m)) / 2π moves with the posture,   f_r / f_a = √(J / J_m)

The one is chosen that explains all postures far better. Wrongly naming one for the other is worse
than saying that it is open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.frequency.config import GroupingConfig
from pipelines.frequency.modes import Modes, Pair
from pipelines.frequency.rational import Known
from pipelines.frequency.spectra import Array

__all__ = ["Explained", "Finding", "Open", "explain", "group_joint", "predicted", "seen_elsewhere"]

_BASE, _JOINT, _GAP = "base_resonance", "joint_elasticity", "backlash"
Spring = tuple[float, float]  # f_b [Hz], I [kg m^2] of a base; k [N m/rad], J_m [kg m^2] of a joint


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
    frequencies: tuple[Known, ...] = ()  # [Hz] `frequency` in each posture


@dataclass(frozen=True)
class Open:
    """An observation with more than one possible cause."""

    joint: int
    frequency: Known | None  # [Hz]
    candidates: tuple[str, ...]
    evidence: str
    experiment: str  # what to record to tell


@dataclass(frozen=True)
class Explained:
    """A set of springs fitted to the pairs of all postures."""

    base: Spring | None
    joint: Spring | None
    std: Array  # relative, of the numbers above in their order
    misfit: float  # χ², with the share that frequencies are granted
    worst: float  # largest relative deviation of a frequency
    freedom: int  # numbers measured less numbers fitted
    config: GroupingConfig

    @property
    def accepted(self) -> bool:
        """Return whether they explain what was measured."""
        return self.misfit <= self.config.tells + self.config.fits * self.freedom


def group_joint(
    joint: int,
    modes: Sequence[Modes],
    sample_time: float,
    load: float = 0.0,
    held: bool = True,
    config: GroupingConfig | None = None,
) -> tuple[list[Finding], list[Open]]:
    """Return what the responses of one joint (1-based), one a posture, say together.

    Args:
        joint: 1-based.
        modes: of each posture.
        sample_time: [s].
        load: least mean torque less friction over its deviation.
        held: whether its input is held over a sample; else the instant is unknown.
        config: what decides.
    """
    config = config or GroupingConfig()
    band = f"from {max(m.band[0] for m in modes):.3g} to {min(m.band[1] for m in modes):.3g} Hz"
    narrow = min(m.band[1] for m in modes) < config.span * max(m.band[0] for m in modes)
    flat, count = max(m.flat for m in modes), min(len(m.pairs) for m in modes)
    changes = f"the magnitude changes {flat:.3g}-fold"

    def ask(
        why: str, record: str, *candidates: str, frequency: Known | None = None
    ) -> tuple[list[Finding], list[Open]]:
        return [], [Open(joint, frequency, candidates, why, record)]

    if max((m.misfit for m in modes if m.scatter > config.left), default=0.0) > config.misfit:
        why = "No linear plant explains the response, as of a gap that is crossed."
        record = "another strength of excitation and a faster turn"
        return ask(why, record, _GAP, _JOINT, _BASE)
    if not count and max(m.hidden for m in modes) > 0.5 * (config.flat - 1.0):
        why = f"No mode {band}, but the response scatters, as by noise or a gap that is crossed."
        return ask(why, "longer, and excited more strongly", _GAP, _JOINT, _BASE)
    late = delay_of(modes, sample_time, held, config)
    if late is not None and late.value < 0.0:
        why = f"Position leads torque by {-1e3 * late.value:.3g} ms, as by two clocks, or faster "
        why += f"motion that has folded back (aliasing); {changes}."
        record = "all signals by one clock, at the controller's own rate"
        return ask(why, record, *((_JOINT, _BASE, _GAP) if flat >= config.flat else ()))
    found: list[Finding] = []
    left: list[Open] = []
    if late is not None and flat < config.flat:
        why = f"The phase falls in proportion to the frequency, {changes}: position comes "
        why += f"{1e3 * late.value:.3g} ± {2e3 * late.std:.2g} ms late, beyond hold and controller."
        about = {"delay": late}
        found.append(Finding("delay", joint, why, "time_delay", parameters=about, seen_at=(joint,)))
    elif late is not None:
        why = f"The phase falls as with {1e3 * late.value:.3g} ms of delay, but {changes}."
        record = "the measured motor current beside the command"
        left += ask(why, record, "drive_lag", "time_delay", "torque_lag")[1]
    strongest = [sorted(m.pairs, key=lambda p: -p.rise) for m in modes]
    extra = [p.resonance.frequency for own in strongest for p in own[count:]]
    extra += [mode.frequency for m in modes for mode in m.single]
    if extra:
        why = f"A mode at {_many(extra)} Hz has no partner, or shows in some postures only."
        record = "longer, to higher frequencies, and in a second posture"
        left += ask(why, record, _BASE, _JOINT, _GAP, "drive_lag", frequency=extra[0])[1]
    if count:
        springs = _springs(joint, modes, [own[:count] for own in strongest], load, config)
        return found + springs[0], springs[1] + left
    if found or left:
        return found, left
    if narrow or flat >= config.flat:
        why = f"No mode is distinct {band}; {changes}."
        record = "longer, more strongly, to lower and higher frequencies"
        return ask(why, record, _JOINT, _BASE, _GAP, "drive_lag")
    why = f"No mode {band} in {len(modes)} posture(s): the acceleration per input is flat within "
    why += f"{100.0 * (flat - 1.0):.2g} %, without delay."
    return [Finding("rigid", joint, why, seen_at=(joint,))], []


def delay_of(
    modes: Sequence[Modes], sample_time: float, held: bool, config: GroupingConfig
) -> Known | None:
    """Return the delay [s], where there is one beyond doubt, of either sign."""
    mean = _mean([m.delay for m in modes])
    least = max((config.delay if held else 1.0) * sample_time, config.sure * mean.std)
    return mean if np.isfinite(mean.value) and abs(mean.value) >= least else None


def _springs(
    joint: int,
    modes: Sequence[Modes],
    strongest: list[list[Pair]],
    load: float,
    config: GroupingConfig,
) -> tuple[list[Finding], list[Open]]:
    """Explain as many pairs in each posture by a base, by a spring in the joint, or by both.

    A gap answers as a spring does as long as it stays closed, and on average where it is crossed
    (its describing function: Gelb, Vander Velde 1968, ch. 2): no open question leaves it out, and
    no spring under a steady load that is damped as teeth are.
    """
    pairs = [sorted(own, key=lambda p: p.antiresonance.frequency.value) for own in strongest]
    known = [m.inertia for m in modes if m.inertia is not None and m.inertia.value > 0.0]
    inertia = [j.value for j in known]
    seen = (
        f"Antiresonance at {_many([p.antiresonance.frequency for own in pairs for p in own])} Hz, "
        f"resonance at {_many([p.resonance.frequency for own in pairs for p in own])} Hz, with "
        f"{', '.join(f'{j:.3g}' for j in inertia) or 'unknown'} kg m² at the joint"
    )

    def open_by(why: str) -> tuple[list[Finding], list[Open]]:
        record = f"joint {joint} in a further posture of the other joints that changes its inertia "
        record += "by a tenth or more"
        lowest = min((p.resonance.frequency for own in pairs for p in own), key=lambda f: f.value)
        return [], [Open(joint, lowest, (_BASE, _JOINT, _GAP), f"{seen}; {why}.", record)]

    single = len(pairs[0]) == 1
    tried: list[Explained] = []
    if len(known) == len(modes):
        spread = [j.std / j.value for j in known]
        kinds = ((True, False), (False, True)) if single else ((True, True),)
        every = (explain(pairs, inertia, kind, spread, config) for kind in kinds)
        tried = [one for one in every if one is not None and one.accepted]
    if not tried:
        return open_by("no base and no spring in the joint explains it")
    best = min(tried, key=lambda one: one.misfit)
    moves = max(inertia) > config.moves * min(inertia)
    if single and min(own[0].rise for own in pairs) > config.heavy:
        tried = [one for one in tried if one.joint is not None]  # no base is lighter than its arm
        best = tried[0] if tried else best
    elif any(one.misfit < best.misfit + config.tells for one in tried if one is not best) or (
        not single and not (moves and len(modes) > 1)
    ):
        return open_by("one posture, or equal inertia, does not tell a base from a joint")
    kinds_of = [
        name for name, one in (("a base", best.base), ("a spring in the joint", best.joint)) if one
    ]
    words = f"{seen}: {' and '.join(kinds_of)} within {100.0 * best.worst:.2g} %."
    found = []
    if best.base is not None:
        found.append(_as_base(joint, best, best.base, pairs, words))
    if best.joint is not None:
        spring = _as_joint(joint, best, best.joint, pairs, inertia, words)
        d = spring.damping
        if d is not None and load > config.closed and d.value + 2.0 * d.std > config.contact:
            words += " But the load on the joint never changes its sign, and teeth in contact are "
            words += f"damped by {d.value:.2g} as well: a gap would stay closed."
            record = f"joint {joint} in a posture without load by gravity"
            return found, [Open(joint, spring.frequency, (_JOINT, _GAP), words, record)]
        found.append(spring)
    return found, []


def _as_base(
    joint: int, one: Explained, base: Spring, pairs: list[list[Pair]], words: str
) -> Finding:
    near = [min(own, key=lambda p: abs(p.resonance.frequency.value - base[0])) for own in pairs]
    each = tuple(p.resonance.frequency for p in near)
    frequency, damping = _mean(each), _mean([p.resonance.damping for p in near])
    inertia = Known(base[1], base[1] * float(one.std[1]))
    about = {"frequency": frequency, "damping_ratio": damping, "inertia": inertia}
    return Finding("base", None, words, _BASE, frequency, damping, about, (joint,), each)


def _as_joint(
    joint: int,
    one: Explained,
    spring: Spring,
    pairs: list[list[Pair]],
    inertia: Sequence[float],
    words: str,
) -> Finding:
    k, motor = spring
    k_std, motor_std = one.std[-2:].tolist()
    link = np.array(inertia) - motor
    locked = (np.sqrt(k / link) / (2.0 * np.pi)).tolist()
    near = [
        min(own, key=lambda p: abs(p.antiresonance.frequency.value - f)).antiresonance
        for own, f in zip(pairs, locked, strict=True)
    ]
    each, damping = tuple(m.frequency for m in near), _mean([m.damping for m in near])
    # it moves with the posture: one number stands for all of them
    frequency = float(np.sqrt(k / link.mean()) / (2.0 * np.pi))
    scatter = float(np.std([f.value for f in each]))
    measured = frequency * max(f.std / f.value for f in each)
    # d = 2 ζ √(k (J - J_m))
    d = float(np.mean([2.0 * m.damping.value for m in near] * np.sqrt(k * link)))
    parts = (damping.std / abs(damping.value), 0.5 * k_std, 0.5 * motor * motor_std / link.mean())
    about = {
        "stiffness": Known(k, k * k_std),
        "damping": Known(d, d * float(np.linalg.norm(parts))),
        "frequency": Known(frequency, float(np.hypot(scatter, 0.5 * frequency * k_std))),
        "motor_inertia": Known(motor, motor * motor_std),
    }
    known = Known(frequency, float(np.hypot(scatter, measured)))
    return Finding("joint", joint, words, _JOINT, known, damping, about, (joint,), each)


def _mean(values: Sequence[Known]) -> Known:
    """Weighted with 1/std²; its deviation holds what the values scatter, too."""
    own = np.array([v.value for v in values])
    weight = 1.0 / np.maximum([v.std for v in values], 1e-12) ** 2
    if not weight.sum() > 0.0:
        return Known(float(own.mean()), np.inf)  # nothing of it is known
    mean = float(weight @ own / weight.sum())
    scatter = float(weight @ (own - mean) ** 2) / max(len(values) - 1, 1)
    return Known(mean, float(np.sqrt(max(scatter, 1.0) / weight.sum())))


def _many(values: Sequence[Known]) -> str:
    return ", ".join(f"{v.value:.4g}" for v in values)


def predicted(
    inertia: float, base: Spring | None, joint: Spring | None, rotor: float = 0.0
) -> tuple[Array, Array]:
    """Antiresonances and resonances [Hz], sorted, of a joint with `inertia` [kg m^2].

    NaN where no such bodies exist. `rotor` [kg m^2] of the inertia turns behind a gear, and does
    not ride on the base.
    """
    f_b, i_b = base or (1.0, 1.0)
    k, motor = joint or (1.0, 0.5 * inertia)
    link, rides = inertia - motor, inertia - rotor
    springs = [row for row, one in ((0, base), (2, joint)) if one]
    numbers = np.array([f_b * f_b * i_b, k, link, motor, i_b, rides])
    if not np.isfinite(numbers).all() or not numbers[2:].min() > 1e-12 * inertia:  # numerics
        none = np.full(len(springs), np.nan)
        return none, none
    mass = np.array([[i_b + rides, rides, link], [rides, inertia, link], [link, link, link]])
    stiffness = np.diag([i_b * (2.0 * np.pi * f_b) ** 2, 0.0, k])
    found = []
    for rows in (springs, [*springs, 1]):  # q locked; free
        own = np.ix_(rows, rows)
        values = np.linalg.eigvals(np.linalg.solve(mass[own], stiffness[own])).real
        found.append(np.sort(np.sqrt(np.maximum(values, 0.0))) / (2.0 * np.pi))
    return found[0], found[1][1:]


def explain(
    pairs: Sequence[Sequence[Pair]],
    inertia: Sequence[float],
    springs: tuple[bool, bool],
    inertia_std: Sequence[float] = (),
    config: GroupingConfig | None = None,
) -> Explained | None:
    """Return what explains the pairs of every posture best; None where counts differ.

    Args:
        pairs: of each posture, by frequency; as many as there are springs.
        inertia: J of each posture [kg m^2].
        springs: whether there is one at the base, and in the joint.
        inertia_std: relative, of J in each posture; none: exactly known.
        config: what frequencies are granted, and what a base weighs at least.
    """
    from scipy.optimize import least_squares

    config = config or GroupingConfig()
    with_base, with_joint = springs
    count = int(with_base) + int(with_joint)
    if any(len(own) != count for own in pairs):
        return None
    modes = [[*(p.antiresonance for p in own), *(p.resonance for p in own)] for own in pairs]
    measured = np.log([[m.frequency.value for m in own] for own in modes])
    std = np.array([[m.frequency.std / m.frequency.value for m in own] for own in modes])
    if len(inertia_std):
        std = np.hypot(std, 0.5 * np.array(inertia_std)[:, None])
    granted = np.hypot(std, config.granted)
    geared = springs == (True, False)

    def bodies(theta: Array) -> tuple[Spring | None, Spring | None, float]:
        with np.errstate(over="ignore"):
            values = np.exp(theta[: 2 * count]).tolist()
        base = (values[0], values[1]) if with_base else None
        joint = (values[-2], values[-1]) if with_joint else None
        # 0 … `rotor` of any real number
        share = 0.5 * config.rotor * (1.0 + float(np.tanh(0.5 * theta[-1]))) if geared else 0.0
        return base, joint, share * min(inertia)

    def rest(theta: Array) -> Array:
        base, joint, rotor = bodies(theta)
        rows = [np.concatenate(predicted(j, base, joint, rotor)) for j in inertia]
        off = ((np.log(rows) - measured) / granted).ravel()
        off = np.where(np.isfinite(off), off, config.impossible)
        if not geared:
            return off
        # a base of nothing, under a rotor, is a link on a spring
        light = min(theta[1] - np.log(config.light * np.mean(inertia)), 0.0) / config.granted
        return np.append(off, light)

    starts = [
        [*start, *rotor]
        for start in _starts(pairs[0], inertia[0], springs)
        for rotor in ([[-4.0], [0.0]] if geared else [[]])
    ]
    best = min(
        (least_squares(rest, start, x_scale="jac") for start in starts), key=lambda o: o.cost
    )
    # the rest, not what was granted, says how well the numbers are known
    weight = np.ones(len(best.fun))
    weight[: std.size] = (granted / np.maximum(std, config.exact)).ravel()
    freedom = std.size - len(best.x)
    scatter = float(((best.fun * weight) ** 2).sum()) / max(freedom, 1)
    slope = best.jac * weight[:, None]
    covariance = np.linalg.pinv(slope.T @ slope)[: 2 * count, : 2 * count] * max(scatter, 1.0)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    worst = float(np.abs(best.fun[: std.size] * granted.ravel()).max())
    base, joint, _ = bodies(best.x)
    return Explained(base, joint, deviations, 2.0 * float(best.cost), worst, freedom, config)


def _starts(first: Sequence[Pair], inertia: float, springs: tuple[bool, bool]) -> list[list[float]]:
    """Each pair of the first posture taken for either spring."""

    def as_base(p: Pair) -> list[float]:
        return [np.log(p.resonance.frequency.value), np.log(inertia / max(p.rise - 1.0, 1e-6))]

    def as_joint(p: Pair) -> list[float]:
        motor = inertia / max(p.rise, 1.0 + 1e-6)
        omega = 2.0 * np.pi * p.antiresonance.frequency.value
        return [np.log((inertia - motor) * omega**2), np.log(motor)]

    if all(springs):
        return [as_base(first[i]) + as_joint(first[1 - i]) for i in (0, 1)]
    return [as_base(first[0]) if springs[0] else as_joint(first[0])]


def seen_elsewhere(
    sure: Sequence[Finding], unsure: Sequence[Open], config: GroupingConfig | None = None
) -> tuple[tuple[Finding, ...], tuple[Open, ...]]:
    """Where the base is known, what other joints show at its frequency is the base as well.

    A base turns under the first joint before any other. What shows at a further joint alone, while
    another bends on a spring, may be that spring: its link swings against a motor that is held.
    """
    config = config or GroupingConfig()

    def same(frequency: Known | None, base: Finding) -> bool:
        if frequency is None or base.frequency is None:
            return False
        return abs(frequency.value - base.frequency.value) < config.near * base.frequency.value

    rest = [one for one in sure if one.kind != "base"]
    bent = [one.joint for one in rest if one.kind == "joint"]
    bases: list[Finding] = []
    for one in (one for one in sure if one.kind == "base"):
        at = next((i for i, base in enumerate(bases) if same(one.frequency, base)), None)
        if at is None:
            bases.append(one)
        else:
            bases[at] = replace(bases[at], seen_at=(*bases[at].seen_at, *one.seen_at))
    left: list[Open] = []
    for one in list(bases):
        others = [joint for joint in bent if joint != one.seen_at[0]]
        if len(one.seen_at) == 1 and one.seen_at != (1,) and others:
            bases.remove(one)
            words = f"{one.evidence} But only this joint shows it, and joint {others[0]} bends."
            record = f"joint {others[0]} made firm, or its brake closed, then this joint again"
            left.append(Open(one.seen_at[0], one.frequency, (_BASE, _JOINT, _GAP), words, record))
    for question in unsure:
        at = next((i for i, base in enumerate(bases) if same(question.frequency, base)), None)
        if at is None or _BASE not in question.candidates:
            left.append(question)
        elif question.joint not in bases[at].seen_at:
            bases[at] = replace(bases[at], seen_at=(*bases[at].seen_at, question.joint))
    return (*bases, *rest), tuple(left)
