"""The page: whole in one file, inert whatever its texts are, and the same bytes every time."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pipelines.report.figures import joint_signal_figure, one_figure
from pipelines.report.render import render_report
from pipelines.report.report import Figure, Report, Section, Table
from tests.report.demo import FOOTER, demo_report

HOSTILE = ["<script>alert(1)</script>", "</svg><img src=x onerror=alert(1)>", "--> </style></title>", "--!><b>",
           "$a_{", "[/bold]", "{{ 7 * 7 }}{% raw %}", '" onload="alert(1)', "\x1b[31mred\x1b]8;;http://evil\x07",
           "\udc80\ud800", "\u202egnp.exe", "名前 \U0001f600", "_hidden", "", "%s %(x)d \\n \\frac", "a\nb\tc\x00\x85",
           "&lt;&#60;", "x" * 5000]


class Tags(HTMLParser):
    """Every tag and attribute of a page, and what it refers to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def handle_comment(self, data: str) -> None:
        raise AssertionError(f"the page holds a comment: {data[:80]}")


def report_of(words: list[str]) -> Report:
    """A report that shows `words` in every place that takes a text."""
    t = np.arange(50) / 100.0
    names = ["", *("".join(words[first:first + 3]) for first in range(0, len(words), 3))]
    values = np.tile(np.sin(20.0 * t)[:, None], (1, len(words)))
    figures = [joint_signal_figure("signals", word, t, values, f"{word} [{word}]", names=words, flagged=values > 0.5,
                                   flag_name=word) for word in words[:1]]
    figures += [one_figure(word, word, lambda axes: axes.plot([0.0, 1.0], [0.0, 1.0])) for word in names]

    def own(drawing: object) -> None:
        axes = drawing.subplots()  # type: ignore[attr-defined]
        axes.set_title(words[0])
        axes.set_ylabel("".join(words[:6]))

    figures.append(Figure("own", words[0], own))
    table = Table(tuple(words), (tuple(words),), caption=words[0], tones=("bad",))
    sections = [Section(word, (word,), (table,)) for word in words]
    return Report(words[0], words[0], "bad", table, (*sections, Section("figures", figures=tuple(figures))))


@pytest.fixture(scope="module")
def demo() -> dict[str, bytes]:
    return render_report(demo_report(), FOOTER)


@pytest.fixture(scope="module")
def hostile() -> dict[str, bytes]:
    return render_report(report_of(HOSTILE), dict.fromkeys(HOSTILE, HOSTILE[0]))


def test_the_page_is_whole_in_one_file_and_runs_nothing(demo: dict[str, bytes]) -> None:
    page = demo["report.html"].decode()
    tags = Tags(page)
    assert not {"script", "link", "iframe", "object", "embed", "img", "image", "base", "form"} & set(tags.tags)
    assert not [name for name, _ in tags.attributes if name.startswith("on")]
    references = [value for name, value in tags.attributes if name in {"href", "src", "xlink:href", "action"}]
    assert references
    assert all(value and value.startswith("#") for value in references)
    assert not re.search(r"https?://|@import|url\((?!#)", page)
    policy = next(value for name, value in tags.attributes if name == "content" and value and "default-src" in value)
    assert "default-src 'none'" in policy
    assert "script-src" not in policy


def test_identifiers_are_unique_and_every_reference_has_its_target(demo: dict[str, bytes]) -> None:
    attributes = Tags(demo["report.html"].decode()).attributes
    names = [value for name, value in attributes if name == "id"]
    assert len(names) == len(set(names))
    targets = {value[1:] for name, value in attributes if name == "href" and value}
    targets |= {found for _, value in attributes for found in re.findall(r"url\(#([^)]+)\)", value or "")}
    assert targets <= set(names)


def test_the_verdict_stands_before_the_evidence_and_is_said_in_words(demo: dict[str, bytes]) -> None:
    words = " ".join("".join(Tags(demo["report.html"].decode()).text).replace("\u00a0", " ").split())
    places = [words.index(part) for part in ("Attention One joint lost its encoder for 0.6 s", "Key figures",
                                             "RRID-S02", "made by")]
    assert places == sorted(places)


def test_equal_bytes_in_another_process(demo: dict[str, bytes], tmp_path: Path) -> None:
    code = ("from pathlib import Path; from tests.report.demo import *\n"
            "from pipelines.report.render import write_report\n"
            f"write_report(demo_report(), Path({str(tmp_path)!r}), FOOTER)")
    environment = {"PATH": "/usr/bin:/bin", "HOME": "/proc/nowhere", "PYTHONHASHSEED": "5", "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=Path(__file__).parents[2], env=environment,
                          capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    for name, content in demo.items():
        assert (tmp_path / name).read_bytes() == content, name
    assert not list(tmp_path.glob("rrrid-*")), "the temporary folder of matplotlib stayed behind"


def test_hostile_texts_add_no_tag_and_no_attribute(hostile: dict[str, bytes]) -> None:
    plain = render_report(report_of(["word"] * 4), {"word": "word"})
    expected, found = Tags(plain["report.html"].decode()), Tags(hostile["report.html"].decode())
    assert set(found.tags) == set(expected.tags)
    assert {name for name, _ in found.attributes} == {name for name, _ in expected.attributes}
    assert "<script>alert(1)</script>" in "".join(found.text), "shown as it was written"
    assert "{{ 7 * 7 }}" in "".join(found.text)


def test_hostile_texts_leave_no_control_character_and_no_unsafe_file_name(hostile: dict[str, bytes]) -> None:
    page = hostile["report.html"].decode()
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", page)
    assert all(re.fullmatch(r"report\.html|figures/[A-Za-z0-9_-]{1,80}\.(svg|png)", name) for name in hostile)
    assert len(hostile) == 1 + 2 * (len(HOSTILE) // 3 + 3), "two figures share a file"


def test_figure_files_are_well_formed_and_hold_no_text(hostile: dict[str, bytes]) -> None:
    for name, content in hostile.items():
        if name.endswith(".svg"):
            elements = ET.fromstring(content).iter()
            assert all(not (element.text or "").strip() or element.tag.endswith("style") for element in elements)
            assert b"script" not in content
            assert b"alert" not in content
        elif name.endswith(".png"):
            assert content.startswith(b"\x89PNG")
            assert b"tEXt" not in content


def test_a_dollar_is_a_letter_and_not_a_formula() -> None:
    """`$x$` typeset as a formula would be one letter wide; as text it is three."""

    def letters(label: str) -> int:
        figure = Figure("one", "", lambda drawing: drawing.text(0.1, 0.5, label))
        files = render_report(Report("", "", sections=(Section("", figures=(figure,)),)), {})
        return files["figures/one.svg"].count(b"<use")

    assert (letters("$x$"), letters("x")) == (3, 1)


def test_tables_align_numbers_and_show_what_is_missing() -> None:
    table = Table(("joint", "range [rad]", "count", "note"),
                  (("1", 3.0, 12000, "a"), ("2", 2.61, None, "b"), ("3", None, 7, "c")))
    page = render_report(Report("t", "v", key_figures=table), {})["report.html"].decode()
    assert '<td class="number">3.00</td><td class="number">12\u202f000</td><td class="short">a</td>' in page
    assert '<td class="number">2.61</td><td class="number">–</td>' in page
    assert 'range <span class="unit">[rad]</span>' in page
