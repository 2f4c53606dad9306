"""The page that plays; its behaviour in headless Chromium, offline, where Chromium is installed."""

import html
import json
import re
import shutil
import subprocess
import time
from dataclasses import replace

import numpy as np
import pytest
from structures import arch_response, parted, pixels, report_of, wall
from test_capacity import ARCH, solved

import solver
from blockvis import show, write_report
from solver import mechanics

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def browser(test):
    """Marks a test that needs Chromium."""
    return pytest.mark.browser(pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")(test))


NASTY = "</script><script>document.title='broken'</script>"


def visit(page, tmp_path, *options):
    """Command of one headless visit, whose console is written to the standard error."""
    profile = tmp_path / f"profile {time.monotonic_ns()}"
    return [
        *(CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars"),
        *("--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={profile}", "--window-size=1200,900"),
        *("--enable-logging=stderr", *options, page),
    ]


def visited(page, tmp_path, *options, anchor="", quiet=True):
    """Output of one headless visit; fails on anything the page writes to the console, if it should be quiet."""
    command = visit(page.as_uri() + anchor, tmp_path, "--virtual-time-budget=5000", *options)
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert not quiet or "CONSOLE" not in done.stderr, done.stderr[-2000:]
    return done.stdout


def body_of(page, tmp_path, anchor=""):
    """The data attributes of the page's body once its script has run."""
    text = visited(page, tmp_path, "--dump-dom", anchor=anchor)
    attributes = dict(re.findall(r'data-([a-z]+)="([^"]*)"', re.search(r"<body[^>]*>", text).group()))
    assert attributes["ready"] == "1"
    return attributes


def checksum(response, increment, page):
    """What the page's script works out from the corners it has unpacked."""
    origin = json.loads(re.search(r'"origin": ?(\[[^]]*\])', page.read_text(encoding="utf-8"))[1])
    corners = (mechanics.moved_vertices(response.assembly, increment.pose) - origin).ravel()
    return float(corners @ (np.arange(len(corners)) % 97 + 1))


@browser
def test_page_unpacks_every_frame_as_it_was(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html")
    for k in (0, len(response.path) - 1, len(response.increments) - 1):
        attributes = body_of(page, tmp_path, f"#frame={k}")
        assert attributes["frame"] == str(k)
        assert float(attributes["corners"]) == pytest.approx(checksum(response, response.increments[k], page), abs=0.02)


@browser
def test_pictures_differ_between_frames(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html")
    pictures = []
    for name, anchor in (("start", "#frame=0"), ("end", f"#frame={len(response.path) - 1}"), ("forces", "#forces=1")):
        visited(page, tmp_path, f"--screenshot={tmp_path / name}.png", anchor=anchor)
        pictures.append(pixels(tmp_path / f"{name}.png"))
    start, end, forces = pictures
    assert (np.abs(start - end).max(axis=2) > 40).sum() > 2000
    assert (np.abs(start - forces).max(axis=2) > 40).sum() > 200


@browser
def test_live_load_stands_where_it_acts_at_each_position(tmp_path):
    response, _ = solved(ARCH, tmp_path)
    page = write_report(response, tmp_path / "report.html")
    columns = []
    for k in (1, 3):
        visited(page, tmp_path, f"--screenshot={tmp_path / str(k)}.png", anchor=f"#frame={k}")
        # Without the legend.
        picture = pixels(tmp_path / f"{k}.png")[:630]
        columns.append(np.nonzero((np.abs(picture - (190, 24, 118)) < 30).all(axis=2))[1])
    assert min(map(len, columns)) > 80
    assert columns[1].mean() - columns[0].mean() > 100
    assert max(map(np.ptp, columns)) < 20
    told = '"loads":[["live","live load '
    assert told in page.read_text(encoding="utf-8")
    assert told not in report_of(arch_response())


@browser
def test_dead_loads_stand_on_what_they_load(tmp_path):
    """Blocks go down under their arrows, which have their length: 4 kN on the top of a stack, beside its weight."""
    boxes = [[[0, y], [1, y], [1, y + 0.5], [0, y + 0.5]] for y in (0.0, 0.5, 1.0, 1.5)]
    stack = solver.Assembly.from_outlines(boxes, roles=["moving", "free", "free", "free"])
    dead = solver.self_weight(stack).dead
    dead[3, 1] -= 4000.0
    sinks = solver.Settlement(direction=(0, -1), increment=0.3, limit=0.3)
    response = solver.settle(stack, sinks, loads=solver.Loads(dead, 0.0 * dead), friction_coefficient=0.6)
    page = write_report(response, tmp_path / "report.html")
    rows = []
    for k in (0, len(response.path) - 1):
        visited(page, tmp_path, f"--screenshot={tmp_path / str(k)}.png", anchor=f"#frame={k}")
        picture = pixels(tmp_path / f"{k}.png")[:630]
        rows.append(np.nonzero((np.abs(picture - (120, 66, 0)) < 30).all(axis=2))[0])
    assert min(map(len, rows)) > 80
    assert rows[1].max() - rows[0].max() > 10
    assert abs(np.ptp(rows[1]) - np.ptp(rows[0])) <= 1
    assert '"loads":[["dead","dead load, longest arrow 4 kN"' in page.read_text(encoding="utf-8")


def test_everything_from_files_is_escaped():
    response = arch_response()
    assembly = replace(response.assembly, names=(NASTY, *response.assembly.names[1:]))
    text = report_of(replace(response, assembly=assembly, message=NASTY, collapse=None), NASTY, title=NASTY)
    assert NASTY not in text
    model = re.search(r'<script id="model" type="application/json">(.*?)</script>', text, re.DOTALL).group(1)
    assert json.loads(model)["names"][0] == NASTY


def test_page_asks_for_nothing():
    text = report_of(arch_response())
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text


def test_page_has_the_numbers_and_the_case():
    response = arch_response()
    text = html.unescape(report_of(response, 'file = "arch.msh"  # <&>'))
    assert f"{response.collapse.displacement:.6g} m" in text
    assert 'file = "arch.msh"  # <&>' in text
    assert "14 (12 free)" in text


@pytest.mark.slow
def test_a_thousand_blocks_and_sixty_frames_stay_below_two_megabytes(tmp_path):
    response = parted(wall(25, 39), 45, 15)
    assert response.assembly.n_blocks > 990
    assert write_report(response, tmp_path / "report.html").stat().st_size < 2_000_000


@pytest.mark.slow
def test_notebook_player_is_a_frame_with_the_page():
    shown = show(arch_response(), height=500)._repr_html_()
    page = html.unescape(re.search(r'srcdoc="(.*?)" style', shown, re.DOTALL).group(1))
    assert page.startswith("<!DOCTYPE html>")
    assert "height:500px" in shown
    assert 'sandbox="allow-scripts allow-downloads"' in shown, "a notebook may save"
