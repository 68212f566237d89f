"""The page in a real browser: nothing overflows on a phone, everything is drawn, and it prints."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines.report.render import write_report
from pipelines.report.report import Table
from tests.report.demo import FOOTER, demo_report

pytestmark = pytest.mark.slow

WIDTHS = (320, 390, 768, 1200)
# The copy that is measured may run a script; the page itself may not.
PROBE = """<script>addEventListener("load", () => parent.postMessage({
  width: innerWidth, page: document.documentElement.scrollWidth,
  figures: [...document.querySelectorAll(".drawing svg")].map(svg => svg.getBoundingClientRect().width),
  tables: [...document.querySelectorAll(".scroll")].map(box => box.scrollWidth - box.clientWidth),
  text: Math.min(...[...document.querySelectorAll("p,td,th,dd")].map(e => parseFloat(getComputedStyle(e).fontSize))),
}, "*"))</script>"""
HARNESS = """<body style="margin:0"><pre id="found"></pre>%s<script>
const found = []; addEventListener("message", e => { found.push(e.data); document.getElementById("found").textContent =
JSON.stringify(found); });</script>"""


def chromium(folder: Path, page: Path, *options: str) -> str:
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert program, "this test needs chromium: apt-get install -y chromium"
    done = subprocess.run(
        [program, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--hide-scrollbars", "--disable-background-networking", "--disable-component-update", "--disable-sync",
         f"--user-data-dir={folder / 'profile'}", *options, page.as_uri()], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    return write_report(demo_report(), folder, FOOTER)[0]


def test_no_width_makes_the_page_scroll_sideways(page: Path, tmp_path: Path) -> None:
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text("utf-8"))
    probe, harness = tmp_path / "probe.html", tmp_path / "harness.html"
    probe.write_text(text.replace("</body>", PROBE + "</body>"), "utf-8")
    frames = [f'<iframe src="{probe.as_uri()}" style="width:{width}px;height:800px;border:0"></iframe>' for width in WIDTHS]
    harness.write_text(HARNESS % "".join(frames), "utf-8")
    dom = chromium(tmp_path, harness, "--virtual-time-budget=10000", "--dump-dom")
    match = re.search(r'<pre id="found">(.*?)</pre>', dom)
    assert match
    found = sorted(json.loads(match[1]), key=lambda frame: frame["width"])
    assert [frame["width"] for frame in found] == list(WIDTHS)
    for frame in found:
        assert frame["page"] <= frame["width"]
        assert all(0.8 * min(frame["width"], 736) <= width <= frame["width"] for width in frame["figures"])
        assert frame["text"] >= 13.0
    assert max(found[-1]["tables"]) <= 0, "on a desk every table is seen whole"
    assert max(found[0]["tables"]) > 0, "on a phone a wide one scrolls inside its box"


def test_key_figures_are_whole_on_paper(tmp_path: Path) -> None:
    """Seven columns, one of them words, as a diagnosis has them: within the 182 mm of an A4 sheet, where nothing scrolls."""
    heads = ("joint", "torque error now [N m]", "extended [N m]", "an arm in order leaves [N m]", "beside it", "now [% of rated]",
             "extended [% of rated]")
    rows = tuple((j, 10.0878, 0.0876, 0.0746, "8.4× → 0.79×, in order", 10.146, 0.146) for j in range(1, 7))
    page = write_report(replace(demo_report(), key_figures=Table(heads, rows, "Of what was held out.")), tmp_path, FOOTER)[0]
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text("utf-8"))
    probe, harness = tmp_path / "probe.html", tmp_path / "harness.html"
    probe.write_text(text.replace("@media print{", "@media all{").replace("</body>", PROBE + "</body>"), "utf-8")
    harness.write_text(HARNESS % f'<iframe src="{probe.as_uri()}" style="width:688px;height:800px;border:0"></iframe>', "utf-8")
    match = re.search(r'<pre id="found">(.*?)</pre>', chromium(tmp_path, harness, "--virtual-time-budget=10000", "--dump-dom"))
    assert match
    (sheet,) = json.loads(match[1])
    assert sheet["page"] <= sheet["width"] == 688
    assert sheet["tables"][0] <= 0
