"""Tell a continuous-integration server what came of the items: JUnit XML, one test case an item.

Equal batches give equal bytes: no times and no names of machines.
"""

from __future__ import annotations

from xml.etree import ElementTree

from pipelines.batch.summary import Summary
from pipelines.errors import clean

__all__ = ["junit_xml"]


def junit_xml(summary: Summary, check: bool) -> str:
    """The report of `summary`; what was found is a failure with `check`, what was rejected or failed an error in any case.

    What could not be done for the batch as a whole is a case of its own, and an error.
    """
    found = summary.count("found") if check else 0
    undone = [one for one in summary.checks if one.gate]
    suite = ElementTree.Element("testsuite", name=f"rrrid batch {summary.stage}", tests=str(len(summary.records) + len(undone)),
                                failures=str(found), errors=str(summary.count("rejected", "failed") + len(undone)), skipped="0")
    for record in summary.records:
        case = ElementTree.SubElement(suite, "testcase", classname=f"rrrid.{summary.stage}", name=_plain(record.name))
        if record.error is not None:
            words = ElementTree.SubElement(case, "error", type=record.error["code"], message=_plain(record.error["message"]))
            words.text = _plain(f"{record.error['where']}: {record.error['message']}. {record.error['remedy']}")
        elif record.status == "found" and check:
            ElementTree.SubElement(case, "failure", type="found", message=_plain(record.verdict))
        elif record.status in ("rejected", "failed"):
            ElementTree.SubElement(case, "error", type=record.status, message=_plain(record.verdict))
    for one in undone:
        case = ElementTree.SubElement(suite, "testcase", classname=f"rrrid.{summary.stage}", name=_plain(one.where))
        words = ElementTree.SubElement(case, "error", type=one.code, message=_plain(one.message))
        words.text = _plain(f"{one.message}. {one.remedy}")
    ElementTree.indent(suite)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(suite, encoding="unicode")}\n'


def _plain(text: str) -> str:
    """Text that XML may hold: beside control characters, it has no place for two further ones."""
    return clean(text, None).replace("\ufffe", "").replace("\uffff", "")
