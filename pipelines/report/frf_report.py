"""The report on frequency responses: what gives way, with the evidence; Fig. 17; modes; the rigid body; methods; recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.fit.rational import Known
from pipelines.model.frf.result import Classified, Method, Posture, Undecided
from pipelines.report.frf_figures import bode_figure, compliance_figure, friction_figure, posture_words, relative_figure
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_number, with_std

__all__ = ["frf_report"]

_PAPER = (np.array([0.0, 0.5 * np.pi]), np.array([0.0, 0.0]))  # [rad] (q2, q3) of Fig. 17
_WRONG = 0.03  # beyond noise: a method this far off is said to be
_TITLES = {"base": "the base", "joint": "joint", "rigid": "rigid", "delay": "delay"}


def frf_report(responses: Sequence[Method], postures: Sequence[Posture], classification: Sequence[Classified],
               undecided: Sequence[Undecided], doctor: Sequence[Check], drawn: Sequence[int]) -> Report:
    """The verdict first. `drawn`: numbers of the postures to draw as Bode plots, none for those of the paper."""
    by_posture = [_methods(posture, responses) for posture in postures]
    sections = [_grouping(classification, undecided), _modes(postures, by_posture)]
    for joint in sorted({p.joint for p in postures}):
        own = [(p, m) for p, m in zip(postures, by_posture, strict=True) if p.joint == joint]
        sections.append(_joint(joint, own, drawn))
    sections += [_rigid(postures), _beside(postures, by_posture), _recorded(postures, by_posture)]
    if doctor:
        sections.append(Section("Data quality", (), (checks_table(doctor),)))
    return Report("Frequency responses", _verdict(classification, undecided, doctor), _tone(classification, undecided, doctor),
                  _key_figures(classification), tuple(sections))


def _methods(posture: Posture, responses: Sequence[Method]) -> dict[str, Method]:
    return {m.method: m for m in responses if m.joint == posture.joint and m.logs == posture.logs}


def _tone(sure: Sequence[Classified], unsure: Sequence[Undecided], doctor: Sequence[Check]) -> Tone:
    if any(check.gate for check in doctor):
        return "bad"
    return "attention" if unsure or any(one.cause for one in sure) else "good"


def _verdict(sure: Sequence[Classified], unsure: Sequence[Undecided], doctor: Sequence[Check]) -> str:
    gates = [f"{check.message[:1].upper()}{check.message[1:]}." for check in doctor if check.gate]
    words = [_said(one) for one in sure if one.kind != "rigid"]
    rigid = [str(one.joint) for one in sure if one.kind == "rigid"]
    if rigid:
        words.append(f"Joint{'s' * (len(rigid) > 1)} {', '.join(rigid)}: rigid in the band.")
    if unsure:
        words += list(dict.fromkeys(_undecided(one) for one in unsure))
        words.append("What to record to decide is listed.")
    return " ".join([*gates, *words]) or "Nothing was measured."


def _undecided(one: Undecided) -> str:
    causes = " or ".join(cause.replace("_", " ") for cause in one.candidates)
    return f"Joint {one.joint} is undecided: {causes or 'not measured well enough'}."


def _said(one: Classified) -> str:
    if one.kind == "delay":
        return f"Joint {one.joint} is measured {format_number(1e3 * one.parameters['delay'].value, 3)} ms late."
    if one.kind == "base":
        return f"Base resonance at {_known(one.frequency)} Hz."
    return f"Compliance in joint {one.joint}: {_each(one)} Hz with its motor locked."


def _each(one: Classified) -> str:
    """The frequency of a link in each posture; of a base one for all, for it does not move."""
    if one.kind == "base" or not one.frequencies:
        return _known(one.frequency)
    return " and ".join(dict.fromkeys(map(_known, one.frequencies)))


def _key_figures(sure: Sequence[Classified]) -> Table | None:
    rows = [(_where(one), _each(one), _known(one.damping), _numbers(one.parameters)) for one in sure if one.cause]
    return Table(("compliance", "frequency [Hz]", "damping ratio", "parameters"), tuple(rows)) if rows else None


def _where(one: Classified) -> str:
    return "base" if one.kind == "base" else f"{'delay of ' if one.kind == 'delay' else ''}joint {one.joint}"


def _known(value: Known | None) -> str:
    return "–" if value is None else with_std(value.value, value.std)


_UNITS = {"stiffness": "N m/rad", "damping": "N m s/rad", "motor_inertia": "kg m²", "inertia": "kg m²", "delay": "s"}


def _numbers(parameters: Mapping[str, Known]) -> str:
    return "; ".join(f"{name.replace('_', ' ')} {with_std(v.value, v.std)} {_UNITS.get(name, '')}".strip()
                     for name, v in sorted(parameters.items()) if name not in ("frequency", "damping_ratio"))


def _grouping(sure: Sequence[Classified], unsure: Sequence[Undecided]) -> Section:
    tables = []
    if sure:
        rows = tuple((_TITLES[one.kind] if one.kind == "base" else f"{_TITLES[one.kind]} {one.joint}" if one.kind == "joint" else
                      f"joint {one.joint}: {_TITLES[one.kind]}", ", ".join(map(str, one.seen_at)), one.evidence) for one in sure)
        tables.append(Table(("what", "seen at joint", "evidence"), rows, "Modes grouped across joints and postures.",
                            tuple("neutral" if one.cause is None else "attention" for one in sure)))
    if unsure:
        tables.append(Table(("joint", "frequency [Hz]", "could be", "why it is open", "what to record"),
                            tuple((one.joint, _known(one.frequency), " or ".join(c.replace("_", " ") for c in one.candidates),
                                   one.evidence, one.experiment) for one in unsure), "Not decided.",
                            tuple("attention" for _ in unsure)))
    text = ("A base resonance has the same frequency in every posture, with a phase lead between its antiresonance and its "
            "resonance. A spring in a joint has an antiresonance that moves with the inertia of the posture, and above its "
            "resonance the motor alone is moved. A delay turns the phase and leaves the magnitude.",)
    return Section("Compliance", text, tuple(tables))


def _modes(postures: Sequence[Posture], methods: Sequence[Mapping[str, Method]]) -> Section:
    columns = ("joint", "posture", "kind", "frequency [Hz]", "damping ratio")

    def rows(which: str) -> tuple[tuple[str | int, ...], ...]:
        return tuple((p.joint, posture_words(p.posture, p.joint), mode.kind, with_std(mode.frequency.value, mode.frequency.std),
                      with_std(mode.damping.value, mode.damping.std))
                     for p, own in zip(postures, methods, strict=True) for mode in getattr(own["closed-loop"], which))

    tables = [Table(columns, found, caption) for found, caption in (
        (rows("modes"), "Value ± std."),
        (rows("traces"), "Traces: an antiresonance and a resonance that nearly cancel. Alone they name nothing.")) if found]
    text = "From a rational function fitted to the default response, weighted with its variance." if tables else \
        "No response has a mode that noise does not explain."
    return Section("Modes", (text,), tuple(tables))


def _joint(joint: int, own: Sequence[tuple[Posture, Mapping[str, Method]]], drawn: Sequence[int]) -> Section:
    shown = _shown(own, drawn)
    postures = [p for p, _ in own]
    figures: list[Figure] = [bode_figure(joint, shown), relative_figure(joint, postures), compliance_figure(joint, postures),
                             friction_figure(joint, postures, [m["closed-loop"] for _, m in own])]
    left = [p for p in postures if p.friction_left is not None]
    text = [f"{len(own)} posture{'s' * (len(own) > 1)}; {len(shown)} drawn as Bode plots (--posture draws others)."]
    if left:
        units = {"r": "rad/s²", "tau": "N m"}
        values = ", ".join(f"{format_number(p.friction_left, 2)} {units[p.input]}" for p in left)
        text.append(f"Half of what the mean input differs between the two directions: {values}. Friction that was not compensated, "
                    "or (negative) compensated too much; at constant speed no spectrum shows it.")
    low = max(p.friction_below for p in postures)
    if low > 0.0:
        text.append(f"Up to {format_number(low, 3)} Hz friction changes the magnitude by more than a tenth.")
    return Section(f"Joint {joint}", tuple(text), (), tuple(figures))


def _shown(own: Sequence[tuple[Posture, Mapping[str, Method]]],
           drawn: Sequence[int]) -> list[tuple[Posture, Mapping[str, Method]]]:
    """The asked-for postures; else those nearest to the paper's two; at most two of another arm."""
    if chosen := [own[k - 1] for k in drawn if 1 <= k <= len(own)]:
        return chosen
    held = [np.delete(p.posture, p.joint - 1) for p, _ in own]
    if len(own) <= 2 or len(held[0]) != len(_PAPER[0]):
        return list(own[:2])
    nearest = dict.fromkeys(int(np.argmin([np.abs(h - wanted).sum() for h in held])) for wanted in _PAPER)
    return [own[k] for k in nearest]


def _rigid(postures: Sequence[Posture]) -> Section:
    rows = [(p.joint, posture_words(p.posture, p.joint), p.expected_level, with_std(p.level.value, p.level.std), p.expected_inertia,
             None if p.inertia is None else with_std(p.inertia.value, p.inertia.std),
             with_std(p.level_above.value, p.level_above.std),
             None if p.delay is None else with_std(1e3 * p.delay.value, 1e3 * p.delay.std), p.expected_from)
            for p in postures]
    text = ("Between friction and the first mode a rigid body accelerates by the same amount per input at every frequency. Under "
            "computed torque that is 1 where the controller's inertia is right. Above all modes only what is fast to the motor "
            "moves. Where the phase advances, no delay is given: modes outside the band, or two clocks, turn it.",)
    return Section("Beside the rigid body", text, (Table(
        ("joint", "posture", "level expected", "measured", "inertia expected [kg m^2]", "measured [kg m^2]",
         "level above all modes", "delay beside hold and controller [ms]", "expected from"), tuple(rows)),))


def _beside(postures: Sequence[Posture], methods: Sequence[Mapping[str, Method]]) -> Section:
    rows, wrong = [], []
    tones: list[Tone] = []
    for p, own in zip(postures, methods, strict=True):
        for name in ("direct", "indirect"):
            if (m := own.get(name)) is None:
                continue
            off = m.difference
            bad = off is not None and off > _WRONG
            rows.append((p.joint, posture_words(p.posture, p.joint), name, None if off is None else 100.0 * off,
                         m.difference_at if bad else None, _bands(m)))
            tones.append("attention" if bad else "neutral")
            if bad and name == "direct" and m.difference_at is not None:
                k = int(np.argmin(np.abs(m.curve.frequency - m.difference_at)))
                wrong.append(f"joint {p.joint} at {format_number(m.difference_at, 3)} Hz, by "
                             f"{format_number(100.0 * (off or 0.0), 3)} % with a coherence of "
                             f"{format_number(float(m.curve.coherence[k]), 2)}")
    warning = (f"The direct method is biased, though its coherence looks fine: {'; '.join(wrong)}. A disturbance goes round the "
               "loop, and input to position then tends to minus the inverse of the controller." if wrong else "")
    columns = ("joint", "posture", "method", "beyond noise off the default, at most [%]", "at [Hz]", "coherence under 0.7 [Hz]")
    table = Table(columns, tuple(rows), "Largest difference from the default where the method's own coherence is 0.7 or more.",
                  tuple(tones))
    tables = [table, *_continuous(postures)]
    text = ("Default: cross spectra of the excitation with position and with input. No disturbance biases their quotient, and it "
            "needs no controller. Indirect: by the sensitivity (Kostić et al. 2004, eq. (29)), with the controller as it was "
            "sampled. Direct: input to position.",)
    return Section("Three methods", text, tuple(tables), (), warning)


def _bands(method: Method) -> str:
    return _said_bands(method.coherence_below_0_7_hz)


def _said_bands(bands: Sequence[tuple[float, float]]) -> str:
    said = ", ".join(f"{format_number(a, 3)}–{format_number(b, 3)}" if b > a else format_number(a, 3) for a, b in bands[:4])
    return f"{said} and {len(bands) - 4} more" if len(bands) > 4 else said or "none"


def _continuous(postures: Iterable[Posture]) -> list[Table]:
    rows = [(p.joint, posture_words(p.posture, p.joint),
             ", ".join(f"{100.0 * p.continuous[f]:.3g} % at {f} Hz" for f in sorted(p.continuous, key=float)))
            for p in postures if p.continuous]
    if not rows:
        return []
    return [Table(("joint", "posture", "error of the indirect method with a continuous controller"), tuple(rows),
                  "What k_p + k_d jω in the place of the sampled controller would have cost. It is not used.")]


def _recorded(postures: Sequence[Posture], methods: Sequence[Mapping[str, Method]]) -> Section:
    motion, spectra = [], []
    for k, (p, own) in enumerate(zip(postures, methods, strict=True)):
        number, default = 1 + sum(q.joint == p.joint for q in postures[:k]), own["closed-loop"]
        motion.append((p.joint, number, posture_words(p.posture, p.joint), ", ".join(p.logs), p.controller, p.speed, p.swing,
                       100.0 * p.left_out, 100.0 * p.filled))
        spectra.append((p.joint, number, _said_bands(p.excited), default.estimator, default.resolution, default.averages,
                        p.distortion, p.detected_even, p.detected_odd))
    text = ("The reference is subtracted. Start, reversal and stop are left out, and half a second after each: there friction "
            "jumps. At constant speed its mean is a constant that no spectrum shows. The excited band is where v has power and its "
            "responses are known to 10 dB: nothing is fitted, judged or named outside. Lost samples are filled alike in all "
            "signals.",)
    return Section("How it was measured", text, (
        Table(("joint", "no.", "posture", "logs", "controller", "speed [rad/s]", "its std [rad/s]", "left out [%]",
               "lost, filled [%]"), tuple(motion)),
        Table(("joint", "no.", "excited band [Hz]", "estimator", "resolution [Hz]", "averages", "realisations", "even lines",
               "odd lines"), tuple(spectra), "Variance between realisations and directions, and power at even and odd lines that "
              "v leaves out: each over that of noise. Far more than 1 is nonlinear distortion.")))
