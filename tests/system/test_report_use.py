"""The report as its readers use it: with mouse, finger, keyboard or screen reader, and what they take away."""

import importlib.util
import json
import os
import re
import subprocess
import threading
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from PIL import Image
from structures import arch_response, parted, pixels, posed, rectangle, report_of, stacked, twisted, wall
from test_report import browser, visit, visited

import blockvis
import solver
from blockvis import write_report
from blockvis.dynamics.fall import fall_of
from blockvis.pictures import palette
from blockvis.pictures.swing import swing_of
from blockvis.results.joints import initial_joints, joint_states
from solver import mechanics

ASK = """<script>const wait = setInterval(async () => { if (!document.body.dataset.ready) return; clearInterval(wait);
  const $ = (id) => document.getElementById(id), canvas = $("blocks"), out = {};
  const key = (name, more = {}, target = canvas) => {
    const event = new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more });
    target.dispatchEvent(event); return event.defaultPrevented; };
  const press = (id) => $(id).click();
  const legend = () => [...$("legend").children].map((item) => item.textContent);
  const shown = () => canvas.toDataURL();
  // A browser without a screen has no frames to wait for.
  window.requestAnimationFrame = (work) => setTimeout(() => work(performance.now()), 16);
  const paused = (ms) => new Promise((done) => setTimeout(done, ms));
  try { await (async () => { SCRIPT })(); } catch (error) { out.error = String(error); }
  console.log(`OUT${encodeURIComponent(JSON.stringify(out))}OUT`); }, 20)</script>"""


def told(page, tmp_path, script, *options, anchor=""):
    """What a script has put into ``out`` on the page, which writes nothing else to the console."""
    asked = tmp_path / "asked.html"
    text = page.read_text(encoding="utf-8")
    asked.write_text(
        text.replace("</body>\n</html>", ASK.replace("SCRIPT", script) + "</body>\n</html>"), encoding="utf-8"
    )
    # By the clock on the wall: virtual time runs out while another thread still compresses a picture.
    command = visit(asked.as_uri() + anchor, tmp_path, *options)
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as chromium:
        watch = threading.Timer(60, chromium.kill)
        watch.start()
        lines = []
        for line in chromium.stderr:
            lines.append(line)
            if "OUT" in line:
                break
        watch.cancel()
        chromium.kill()
    # WebGL in software writes to the console that it is slow.
    said = [line for line in lines if "CONSOLE" in line and "WebGL" not in line]
    assert len(said) == 1, "".join(lines)[-2000:]
    found = json.loads(unquote(said[0].split("OUT")[1]))
    assert "error" not in found, found["error"]
    return found


@pytest.mark.thorough
def test_title_names_case_file_date_and_version(tmp_path):
    text = (
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\nincrement = 0.05\nlimit = 0.05\n'
        "[analysis]\nfalling_frames = 0\n[output]\nanimation = false\n"
    )
    (tmp_path / "garden wall.toml").write_text(text, encoding="utf-8")
    run = blockvis.run_case(tmp_path / "garden wall.toml", tmp_path / "out", outputs=())
    page = report_of(run.response, text)
    title = re.search("<title>(.*?)</title>", page).group(1)
    assert title == "garden wall · Standing at the end of the settlement"
    about = re.search('<p id="about">(.*?)</p>', page).group(1)
    finished = run.summary["finished"].replace("T", " ").replace("Z", " UTC")
    assert about == f"garden wall.toml · {finished} · blockvis {run.summary['versions']['blockvis']}"
    # The same of a folder that is opened again, whenever that is.
    assert report_of(blockvis.open_results(run.folder), text) == page


def test_notes_of_the_run_are_in_the_report():
    response = parted(wall(5, 4), 3, 0)
    noted = replace(response.increments[1], notes=("block <A> moved by 72 mm at once",))
    page = report_of(replace(response, increments=(response.increments[0], noted, response.increments[2])))
    assert '<ul id="notes"><li>block &lt;A&gt; moved by 72 mm at once</li></ul>' in page
    assert 'id="notes"' not in report_of(response)


def failed(response):
    return replace(
        response, stop=solver.Status.SOLVER_FAILED, collapse=None, message="a point is off by 1e-7 m",
        increments=response.path,
    )  # fmt: skip


def test_the_failure_of_a_run_is_the_heading():
    page = report_of(failed(arch_response()))
    assert "solver failed" in re.search("<h1>(.*?)</h1>", page).group(1).lower()
    banner = re.search('<p class="failed">(.*?)</p>', page).group(1)
    assert "The solver failed after settlement 0.1410 m: a point is off by 1e-7 m" in banner
    assert 'class="failed"' not in report_of(arch_response())


@browser
def test_the_tip_of_a_block_lists_its_joints(tmp_path):
    response = arch_response()
    last = len(response.path) - 1
    page = write_report(response, tmp_path / "report.html")
    script = """for (let k = 0; k < 6; k++) key("n"); out.tip = $("tip").textContent; out.label = canvas.ariaLabel;
      key("p"); out.back = $("tip").textContent; key("Escape"); out.gone = $("tip").style.display;
      const box = canvas.getBoundingClientRect();
      for (let y = 0.1; y < 0.8 && $("tip").style.display !== "block"; y += 0.01) canvas.dispatchEvent(new PointerEvent(
        "pointerdown", { pointerType: "touch", pointerId: 5, clientX: box.left + box.width / 2.05,
        clientY: box.top + y * box.height }));
      out.tap = $("tip").textContent;"""
    found = told(page, tmp_path, script, anchor=f"#frame={last}")
    assembly, increment = response.assembly, response.path[-1]
    states = joint_states(assembly, initial_joints(assembly), increment)
    joint = next(
        k for k in range(len(states.ends))
        if {assembly.names[states.block_a[k]], assembly.names[states.block_b[k]]} == {"voussoir 6", "voussoir 7"}
    )  # fmt: skip
    assert found["tip"].startswith("voussoir 6 · ")
    line = next(line for line in found["tip"].splitlines() if "joint with voussoir 7" in line)
    numbers = re.search(r"opening ([\d.]+) mm, slip ([\d.]+) mm, N ([\d.]+) (k?)N, T (-?[\d.]+) (k?)N", line)
    assert float(numbers[1]) == pytest.approx(1e3 * states.opening[joint], abs=0.006)
    assert float(numbers[2]) == pytest.approx(0.0, abs=0.006)
    normal, shear = (float(numbers[k]) * (1e3 if numbers[k + 1] else 1.0) for k in (3, 5))
    assert normal == pytest.approx(states.normal_force[joint], rel=0.01)
    assert abs(shear) == pytest.approx(abs(states.shear_force[joint]), abs=0.01 * normal)
    assert "displacement " in found["tip"]
    assert "voussoir 6; " not in found["label"]
    assert "voussoir 6" in found["label"], "a screen reader hears the block"
    assert found["back"].startswith("voussoir 5 · ")
    assert found["gone"] == "none"
    assert "voussoir" in found["tap"], "a tap tells about a block as well"


@browser
def test_toggles_change_the_picture_and_the_legend_follows(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html")
    script = """out.before = legend(); out.counts = [$("hinges-text").textContent, $("sliding-text").textContent];
      out.changed = {}; out.legends = {};
      for (const name of ["cracks", "hinges", "forces", "thrust", "start", "displacement", "mechanism"]) {
        const was = shown(); press(name); out.changed[name] = shown() !== was;
        out.legends[name] = legend().join(" | "); }
      press("displacement"); key("End"); out.falling = legend();"""
    found = told(page, tmp_path, script, anchor=f"#frame={len(response.path) - 1}")
    assert all(found["changed"].values()), found["changed"]
    hinges = len(mechanics.mechanism_of(response.assembly, swing_of(response).increment).hinges)
    assert found["counts"] == [f"hinges ({hinges})", "sliding joints (0)"]
    assert "open joint" in found["before"]
    assert "sliding joint" not in found["before"], "the arch slides nowhere"
    assert "open joint" not in found["legends"]["cracks"]
    assert "hinge" not in found["legends"]["hinges"]
    assert "resultant of a joint" in found["legends"]["forces"]
    assert "thrust line" in found["legends"]["thrust"]
    assert "settlement" not in found["legends"]["start"]
    assert "displacement, 0 to " in found["legends"]["displacement"]
    assert " mm or more" not in found["legends"]["displacement"]
    assert any(re.fullmatch("displacement, 0 to .* mm or more", entry) for entry in found["falling"])
    assert "parts of the mechanism" in found["legends"]["mechanism"]


@browser
def test_the_mechanism_has_the_colours_of_its_picture(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html")
    anchor = f"#frame={len(response.path) - 1}&colours=mechanism"
    visited(page, tmp_path, f"--screenshot={tmp_path / 'page.png'}", anchor=anchor)
    picture = pixels(tmp_path / "page.png")
    blockvis.draw_mechanism(response, tmp_path / "mechanism.png")
    drawn = pixels(tmp_path / "mechanism.png")
    parts = swing_of(response).parts
    fill = palette.block_colours(response.assembly.materials, response.assembly.free)
    for colour in np.unique(palette.part_colours(fill, parts)[parts >= 0], axis=0).astype(int):
        for where in (picture, drawn):
            assert (np.abs(where - colour).max(axis=2) <= 2).sum() > 100


@browser
def test_on_walls_of_many_blocks_dots_are_off_in_picture_and_legend(tmp_path):
    found = told(
        write_report(parted(wall(20, 18), 4, 0), tmp_path / "report.html"), tmp_path,
        'out.legend = legend().join(" | "); out.boxes = [$("hinges").checked, $("sliding").checked];'
        'press("sliding"); out.after = legend().join(" | ");',
    )  # fmt: skip
    assert found["boxes"] == [False, False]
    assert "are off: they would hide the cracks" in found["legend"]
    assert "sliding joint" in found["after"].split("are off")[0]


@browser
def test_keyboard_plays_steps_and_zooms_and_the_slider_says_where_it_is(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html", fall=fall_of(response))
    script = """const frame = () => Number(document.body.dataset.frame);
      out.opened = frame(); out.falls = $("badge").style.display;
      key("Home"); key("ArrowRight"); key("ArrowRight"); out.two = frame(); key("ArrowLeft"); out.one = frame();
      key("End"); out.last = frame(); out.fall = $("frame").getAttribute("aria-valuetext");
      key("Home"); out.first = frame(); out.start = $("frame").getAttribute("aria-valuetext");
      const was = shown(); key("+"); out.closer = shown() !== was; key("0"); out.fits = shown() === was;
      key("ArrowRight", { shiftKey: true }); out.moved = shown() !== was; out.stays = frame(); key("0");
      key(" ", {}, $("fit")); await paused(700); out.played = frame() > 0; key(" ", {}, document.body);
      out.paused = $("play").textContent;
      $("frame").value = 3; $("frame").dispatchEvent(new Event("input")); out.slid = frame();
      out.live = $("state").getAttribute("aria-live"); out.role = canvas.getAttribute("role");
      out.label = canvas.ariaLabel; out.curve = [$("curve").getAttribute("role"), $("curve").ariaLabel];"""
    found = told(page, tmp_path, script)
    # The page opens on the last equilibrium.
    assert (found["opened"], found["falls"]) == (len(response.path) - 1, "none")
    assert (found["two"], found["one"], found["first"], found["stays"], found["slid"]) == (2, 1, 0, 0, 3)
    assert found["last"] > len(response.path)
    assert found["start"].startswith("Settlement 0.0000 m")
    assert "fall: rigid-body dynamics" in found["fall"]
    assert found["closer"]
    assert found["fits"]
    assert found["moved"]
    assert found["played"]
    assert found["paused"] == "▶ Play"
    assert found["live"] == "polite"
    assert found["role"] == "application"
    assert found["label"] == "The blocks: 14, of which 12 are free"
    assert found["curve"][0] == "img"
    assert "reaction" in found["curve"][1]


@browser
def test_wheel_and_finger_are_the_pages_and_targets_are_large_enough(tmp_path):
    page = write_report(arch_response(), tmp_path / "report.html")
    script = """const turned = (ctrlKey) => {
        const event = new WheelEvent("wheel", { deltaY: 90, ctrlKey, bubbles: true, cancelable: true });
        canvas.dispatchEvent(event); return event.defaultPrevented; };
      const was = shown(); out.wheel = turned(false); out.same = shown() === was; out.zoom = turned(true);
      out.zoomed = shown() !== was; out.touch = getComputedStyle(canvas).touchAction;
      out.small = [...document.querySelectorAll("button, input, select, summary")].filter((one) => {
        const box = one.getBoundingClientRect(); return box.width < 24 || box.height < 24; }).map((one) => one.id);
      out.wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;"""
    for size in ("1200,900", "390,800"):
        found = told(page, tmp_path, script, f"--window-size={size}")
        assert (found["wheel"], found["same"], found["zoom"], found["zoomed"]) == (False, True, True, True)
        assert found["touch"] == "pan-y"
        assert found["small"] == []
        assert found["wide"] <= 0


@browser
def test_what_is_seen_can_be_saved(tmp_path):
    response = arch_response()
    page = write_report(response, tmp_path / "report.html")
    script = """const saved = []; const make = URL.createObjectURL;
      URL.createObjectURL = (blob) => { saved.push(blob); return make(blob); };
      out.names = []; HTMLAnchorElement.prototype.click = function () { out.names.push(this.download); };
      press("mechanism"); for (const id of ["svg", "csv", "joints", "png"]) press(id);
      for (let k = 0; k < 100 && saved.length < 4; k++) await paused(50);
      out.texts = await Promise.all(saved.slice(0, 3).map((blob) => blob.text()));
      out.png = [saved[3].type, saved[3].size];"""
    found = told(page, tmp_path, script, anchor=f"#frame={len(response.path) - 1}")
    assert [Path(name).suffix for name in found["names"]] == [".svg", ".csv", ".csv", ".png"]
    picture, curve, joints = found["texts"]
    assert picture.startswith("<svg xmlns=")
    assert picture.count("<path") > response.assembly.n_blocks
    assert "Settlement 0.1410 m" in picture
    rows = [row.split(",") for row in curve.splitlines()]
    assert rows[0] == ["settlement [m]", "reaction [kN]"]
    assert len(rows) == 1 + len(response.path)
    assert float(rows[-1][1]) == pytest.approx(response.path[-1].reaction / 1e3, rel=1e-5)
    rows = [row.split(",") for row in joints.splitlines()]
    assert rows[0] == ["joint", "opening [mm]", "slip [mm]", "N [N]", "T [N]"]
    widest = max(rows[1:], key=lambda row: float(row[1]))
    assert widest[0] in ("voussoir 6 | voussoir 7", "voussoir 7 | voussoir 6")
    assert found["png"][0] == "image/png"
    assert found["png"][1] > 5_000


@browser
def test_every_face_of_two_blocks_is_told_its_own_forces_however_small(tmp_path):
    corner = np.array([[0, 0], [2, 0], [2, 0.5], [0.5, 0.5], [0.5, 2], [0, 2]])
    shapes = [rectangle(-1, -0.5, 3, 0), corner, rectangle(0.5, 0.5, 1.5, 1.5), rectangle(0.6, 1.5, 0.62, 1.52)]
    assembly = solver.Assembly.from_outlines(shapes, roles=["moving", "free", "free", "free"])
    response = solver.settle(assembly, solver.Settlement((0, -1), increment=1e-3, limit=1e-3))
    script = """let saved; URL.createObjectURL = (blob) => { saved = blob; return "#"; };
      HTMLAnchorElement.prototype.click = () => {}; press("joints"); out.text = await saved.text();
      key("n"); out.tip = $("tip").textContent;"""
    found = told(write_report(response, tmp_path / "report.html"), tmp_path, script)
    joints = initial_joints(assembly)
    states = joint_states(assembly, joints, response.path[-1])
    written = np.array([row.split(",")[3:] for row in found["text"].splitlines()[1:]], dtype=float)
    exact = np.stack([states.normal_force, states.shear_force], axis=1)[: len(joints)]
    # The page has four digits.
    assert written == pytest.approx(exact, rel=5e-4, abs=1e-6 * exact.max())
    pebble = 9.81 * assembly.masses[3]
    assert written[states.block_b[: len(joints)] == 3, 0] == pytest.approx([pebble], rel=2e-3)
    assert all("N 0 N" not in line for line in found["tip"].splitlines())


@browser
def test_slips_in_the_report_are_those_of_joints_in_the_plane_and_in_space(tmp_path):
    script = """let saved; URL.createObjectURL = (blob) => { saved = blob; return "#"; };
      HTMLAnchorElement.prototype.click = () => {}; press("joints"); out.text = await saved.text();"""
    for moved in (stacked(shift=(0.2, 0.1), turn=0.2), twisted([1, 0], (0, 0), 0.4)):
        response = replace(posed(*moved), settlements=())
        found = told(write_report(response, tmp_path / "report.html"), tmp_path, script)
        slip = float(found["text"].splitlines()[1].split(",")[2])
        assert slip == pytest.approx(1e3 * response.joints()["slip"][0], abs=1e-3)


@browser
def test_on_narrow_screens_the_title_of_a_saved_picture_is_whole(tmp_path):
    page = write_report(arch_response(), tmp_path / "report.html")
    script = """const saved = []; URL.createObjectURL = (blob) => { saved.push(blob); return "#"; };
      canvas.style.width = "200px"; window.dispatchEvent(new Event("resize")); await paused(100); press("svg");
      const title = new DOMParser().parseFromString(await saved[0].text(), "image/svg+xml").querySelectorAll("text");
      const text = [...title].at(-1), pen = document.createElement("canvas").getContext("2d");
      pen.font = `${text.getAttribute("font-size")}px ${text.getAttribute("font-family")}`;
      out.width = canvas.clientWidth;
      out.title = pen.measureText(text.textContent).width; out.text = text.textContent;"""
    found = told(page, tmp_path, script)
    assert found["width"] < 320, found
    assert found["text"].startswith("Settlement ")
    assert 14 + found["title"] <= found["width"]


@browser
def test_dark_rooms_get_a_dark_page_and_those_who_ask_get_less_motion(tmp_path):
    page = write_report(arch_response(), tmp_path / "report.html")
    for name, options in (("light", ()), ("dark", ("--blink-settings=preferredColorScheme=0",))):
        visited(page, tmp_path, f"--screenshot={tmp_path / name}.png", *options)
    light, dark = (np.asarray(Image.open(tmp_path / f"{name}.png").convert("L")) for name in ("light", "dark"))
    assert np.median(light) > 240
    assert np.median(dark) < 60
    # Lines of the legend have a pale rim like dots: black is seen in the dark, too.
    rim = 'out.rim = getComputedStyle(document.querySelector(".key.line")).boxShadow;'
    assert "255, 255, 255" in told(page, tmp_path, rim)["rim"]
    # No picture between two increments is drawn: the blocks step.
    script = """const seen = new Set(); press("play");
      for (let k = 0; k < 60; k++) { await paused(25); seen.add(document.body.dataset.corners); }
      out.seen = seen.size;"""
    calm = told(page, tmp_path, script, "--force-prefers-reduced-motion")["seen"]
    usual = told(page, tmp_path, script)["seen"]
    assert calm <= 4
    assert usual > 2 * calm


#: A wheel that brings axe-core along.
WITH_AXE = importlib.util.find_spec("axe_playwright_python")
AXE = next(
    (
        file
        for file in (
            Path(os.environ.get("AXE", "")),
            *(Path(folder) / "axe.min.js" for folder in (WITH_AXE.submodule_search_locations if WITH_AXE else ())),
        )
        if file.is_file()
    ),
    None,
)


@browser
@pytest.mark.skipif(AXE is None, reason="no axe-core: pip install --no-deps axe-playwright-python, or AXE=axe.min.js")
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(scheme, tmp_path):
    response = replace(parted(wall(6, 5), 4, 3), message="made up")
    page = write_report(response, tmp_path / "report.html", "# a case\n" * 80)
    axe = AXE.read_text(encoding="utf-8").replace("</script", "<\\/script")
    page.write_text(
        page.read_text(encoding="utf-8").replace("<script id", f"<script>{axe}</script><script id", 1),
        encoding="utf-8",
    )
    rules = '{ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"] }'
    script = f"""key("n"); const found = await axe.run(document, {rules}); out.rules = found.passes.length;
      out.wrong = found.violations.map((one) => [one.id, one.nodes.map((node) => node.html)]);"""
    options = ("--blink-settings=preferredColorScheme=0",) if scheme == "dark" else ()
    found = told(page, tmp_path, script, *options)
    assert found["wrong"] == []
    assert found["rules"] > 20
