"""The report of an extension: what it gains on held-out logs, every cause with its proof, what was not accepted and why."""

from __future__ import annotations

from pipelines.diagnosis.result import Extension
from pipelines.report.diagnosis_finding import finding_section, gain_table, numbers_section
from pipelines.report.diagnosis_floor import held_out_words, judge_words, torque_errors
from pipelines.report.diagnosis_words import named, title_of, together, without_keys
from pipelines.report.joint_units import Units, units_in
from pipelines.report.model_words import laws_words
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.tip_words import tip_change

__all__ = ["extension_report"]

# Of a spring of 3 N m and an offset, a touch more among the causes moved it by 1, 25 and 3 parts in ten thousand, joint by joint.
_NOW = ("Now: fitted without what it is extended by. \"rrrid diagnose\" may give it slightly otherwise where its causes are not "
        "just these, for what sampling does to the numbers is taken out as it shows with all causes. ")
_OF_BEFORE = ("Now: by the base parameters of before, without {0}, as \"rrrid diagnose\" gives it: fitted to these logs they take "
              "it in, and leave less. ")
_NOISE = ("noise of the residual", "Noise of the residual: the part of it that is white in time, which no model can explain. "
          "A healthy arm leaves more than that, for instance where it reverses: the report of \"rrrid diagnose\" on these logs "
          "says how much, and whether the residual of the extended model is normal.")


def extension_report(result: Extension) -> Report:
    """Verdict, key figures, one section a cause, what was refused."""
    tone: Tone = "good" if result.accepted else "attention" if result.findings else "bad"
    units = units_in(result)
    sections = [section for number, one in enumerate(result.findings, 1)
                for section in (finding_section(number, one, result.residual_rms, offer=False, floor="the noise",
                                                units=units),
                                numbers_section(number, one, units))]
    if result.rejected:
        rows = tuple((title_of(one.cause), one.joint, without_keys(one.reason)) for one in result.rejected)
        sections.insert(0, Section("Not accepted", ("The held-out logs do not bear it out. There is no way around that.",),
                                   (Table(("cause", "joint", "why"), rows),)))
    sections.append(_basis(result, units))
    if result.data_quality:
        sections.append(Section("Data quality", (), (checks_table(result.data_quality),)))
    return Report(f"Extension of {result.robot}" if result.robot else "Extension", _verdict(result), tone,
                  torque_errors(result.residual_rms, result.after_rms, result.rated, result.residual_rms.noise_floor, _NOISE[0],
                                f"{_now(result)}{_NOISE[1]}", units),
                  tuple(sections), basis=(laws_words(result.laws_of, fewer=result.fewer_terms),))


def _now(result: Extension) -> str:
    """Whose error "now" is, beside what an extension leaves: who has asked `diagnose` lays the two side by side."""
    if not result.findings:
        return ""
    load = [named(one.cause, one.joint) for one in result.findings if one.origin == "base parameters"]
    return _OF_BEFORE.format(load[0]) if load else _NOW


def _verdict(result: Extension) -> str:
    refused, found = (", ".join(words for _, words in together(some)) for some in (result.rejected, result.findings))
    if not result.findings:
        return f"Not accepted: {refused}; no model was written. {_first_reason(result)}"
    change = "" if result.gain is None else tip_change(result.gain)
    told = f"; with it {change}" if change else ""
    but = f" Not accepted: {refused}." if refused else ""
    return f"The model with {found}, all its numbers fitted again, is better on {judge_words(result.held_out)}{told}.{but}"


def _first_reason(result: Extension) -> str:
    reason = result.rejected[0].reason if result.rejected else "no cause was named"
    reason = without_keys(reason)
    return f"{reason[:1].upper()}{reason[1:]}."


def _basis(result: Extension, units: Units) -> Section:
    text = [laws_words(result.laws_of, fewer=result.fewer_terms), held_out_words(result.held_out),
            "A cause is accepted where its gain on held-out torque is beyond its bootstrap interval, where the logs agree on its "
            "size, where no held-out log gets worse by more than a tenth, and where the simulated arm comes nearer to the measured "
            "one."]
    if result.baseline_effects:
        text.append(f"The reference logs show as well, and the model has: {', '.join(map(without_keys, result.baseline_effects))}.")
    if result.model is not None:
        text.append("model.json holds the extended model with everything refitted; \"rrrid simulate model.json --replay LOG\" "
                    "simulates it.")
    tables = (gain_table(result.gain, "Gain of all accepted causes together, on held-out time, root mean square.",
                         units),) \
        if result.gain is not None and len(result.findings) > 1 else ()
    return Section("What this rests on", tuple(text), tables)
