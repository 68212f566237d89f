"""The report of an extension: its gain on held-out logs, each cause with its proof, refusals."""

from __future__ import annotations

from functools import partial

from pipelines.diagnosis.result import Extension
from pipelines.report.diagnosis_finding import (
    finding_section,
    gain_table,
    numbers_section,
    tip_change,
)
from pipelines.report.diagnosis_report import torque_errors
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import data_quality
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.words import (
    Units,
    laws_words,
    named,
    title_of,
    together,
    units_in,
    without_keys,
)

_say = partial(sentence, "diagnosis")


def extension_report(result: Extension) -> Report:
    """Verdict, key figures, one section a cause, what was refused."""
    units, before = units_in(result), result.residual_rms
    sections = [*_refused(result)]
    for number, one in enumerate(result.findings, 1):
        sections.append(finding_section(number, one, before, False, "the noise", units))
        sections.append(numbers_section(number, one, units))
    sections += [_basis(result, units), *data_quality(result.data_quality)]
    tone: Tone = "good" if result.accepted else "attention" if result.findings else "bad"
    words = f"{_now(result)} {_say('extension_noise')}".strip()
    floor, name = before.noise_floor, "noise of the residual"
    errors = torque_errors(before, result.after_rms, result.rated, floor, name, words, units)
    title = f"Extension of {result.robot}" if result.robot else "Extension"
    basis = (laws_words(result.laws_of, fewer=result.fewer_terms),)
    return Report(title, _verdict(result), tone, errors, tuple(sections), basis=basis)


def _now(result: Extension) -> str:
    """Whose error "now" is, as the same figure of `diagnose` may differ from it."""
    if not result.findings:
        return ""
    loads = [o for o in result.findings if o.origin == "base parameters"]
    return _say("extension_now", named(loads[0].cause, loads[0].joint) if loads else "")


def _verdict(result: Extension) -> str:
    refused = [words for _, words in together(result.rejected)]
    found = [words for _, words in together(result.findings)]
    reason = result.rejected[0].reason if result.rejected else "no cause was named"
    tip = "" if result.gain is None else tip_change(result.gain)
    return _say("extension", result, found, refused, without_keys(reason), tip)


def _refused(result: Extension) -> list[Section]:
    if not result.rejected:
        return []
    rows = tuple((title_of(o.cause), o.joint, without_keys(o.reason)) for o in result.rejected)
    text = "The held-out logs do not bear it out. There is no way around that."
    return [Section("Not accepted", (text,), (Table(("cause", "joint", "why"), rows),))]


def _basis(result: Extension, units: Units) -> Section:
    laws = laws_words(result.laws_of, fewer=result.fewer_terms)
    baseline = [without_keys(name) for name in result.baseline_effects]
    text = paragraphs("diagnosis", "extension_basis", laws, result, baseline)
    tables: tuple[Table, ...] = ()
    if result.gain is not None and len(result.findings) > 1:
        caption = "Gain of all accepted causes together, on held-out time, root mean square."
        tables = (gain_table(result.gain, caption, units),)
    return Section("What this rests on", text, tables)
