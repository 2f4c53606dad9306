"""Names that would be scripts, in a real browser: none of them runs, and the page shows every one as it is."""

import html
import json
import re
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from structures import parted, report_of, wall
from test_report import browser, visited

import blockvis
from blockvis import write_report

#: What each payload does if it runs: the body is marked, whatever it is marked with.
RUN = "document.body.dataset.broken=1"

HOSTILE = (
    f"<script>{RUN}</script>",
    f"</script><script>{RUN}</script>",
    f"</SCRIPT ><sCrIpT>{RUN}//",
    f"<img src=x onerror={RUN}>",
    f'"><img src="x" onerror="{RUN}">',
    f"'><svg/onload='{RUN}'>",
    f"</title><script>{RUN}</script>",
    f"</pre></details><iframe srcdoc='<script>parent.{RUN}</script>'></iframe>",
    f"</td></tr></table><body onload={RUN}>",
    f"<!--<script>{RUN}//-->",
    f"--><script>{RUN}</script><!--",
    f"]]><script>{RUN}</script><![CDATA[",
    f'"}}]}};{RUN};//',
    f'\\"]}};{RUN};//',
    f"\\u003cscript\\u003e{RUN}\\u003c/script\\u003e",
    f"&lt;script&gt;{RUN}&lt;/script&gt;",
    f"&#60;script&#62;{RUN}",
    f"`${{{RUN}}}`",
    f"javascript:{RUN}",
    f"\u2028{RUN}\u2029{RUN}",
    f"$script ${{model}} $$ {RUN}",
    f"<a href='javascript:{RUN}' autofocus onfocus={RUN} tabindex=1>x</a>",
    f"<style>@import 'javascript:{RUN}'</style><meta http-equiv=refresh content='0;javascript:{RUN}'>",
    "\u202e<b>right to left</b>\u0007\x7f é 中 🧱",
)

#: Looks at the page as a reader does: the pointer goes over all of it, and whatever is shown there is noted.
PROBE = """<script id="probe">(() => { const wait = setInterval(() => { if (!document.body.dataset.ready) return;
  clearInterval(wait);
  const canvas = document.getElementById("blocks"), box = canvas.getBoundingClientRect(), tips = new Set(), n = 90;
  for (let k = 0; k < n * n; k++) {
    const clientX = box.left + box.width * (k % n + 0.5) / n;
    const clientY = box.top + box.height * (Math.floor(k / n) + 0.5) / n;
    canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY }));
    const tip = document.getElementById("tip");
    if (tip.style.display === "block") tips.add(tip.textContent.split("\\ndisplacement ")[0]);
    if (tip.children.length) document.body.dataset.broken = 1;
  }
  const kinds = {};
  for (const element of document.querySelectorAll("*")) kinds[element.localName] = (kinds[element.localName] || 0) + 1;
  const found = { tips: [...tips], kinds, title: document.title, heading: document.querySelector("h1").textContent,
    summary: document.getElementById("summary").innerText, case: document.querySelector("pre").textContent };
  document.body.dataset.found = JSON.stringify(found).replace(/[^ -~]/g,
    (c) => "\\\\u" + c.charCodeAt(0).toString(16).padStart(4, "0"));
}, 20); })()</script>"""


def seen(page, tmp_path, *, quiet=True):
    """What the probe saw on a page; "broken" tells whether anything ran that should not."""
    probed = tmp_path / "probed.html"
    probed.write_bytes(page.read_bytes().replace(b"</body>\n</html>", PROBE.encode() + b"</body>\n</html>"))
    body = re.search(r"<body[^>]*>", visited(probed, tmp_path, "--dump-dom", quiet=quiet)).group()
    found = re.search(r'data-found="([^"]*)"', body)
    return {**(json.loads(html.unescape(found.group(1))) if found else {}), "broken": "data-broken" in body}


def named(names, materials):
    """A wall with these names, the last two those of its footings, and these materials."""
    response = parted(wall(5, 4), 3, 2)
    n = response.assembly.n_blocks
    assert len(names) == len(materials) == n
    return replace(response, assembly=replace(response.assembly, names=tuple(names), materials=tuple(materials)))


def as_shown(text):
    """A text as a browser lays it out: white space taken together, signs that have no shape left out."""
    return re.sub(r"[\t\n\f\r ]+", " ", re.sub(r"[\x00-\x08\x0e-\x1f\x7f\u2028\u2029]", "", text)).strip(" ")


def plain(tmp_path):
    """What the probe sees on a page with harmless names."""
    response = replace(named([f"block {k}" for k in range(24)], ["stone"] * 24), message="made up", collapse=None)
    return seen(write_report(response, tmp_path / "plain.html", "case"), tmp_path)


@browser
def test_hostile_names_are_shown_and_none_runs(tmp_path):
    assert len(HOSTILE) == 24
    materials = [*HOSTILE[1:], HOSTILE[0]]
    response = replace(named(HOSTILE, materials), message=" ".join(HOSTILE), collapse=None)
    case = "\n".join(HOSTILE)
    found = seen(write_report(response, tmp_path / "report.html", case, title=case), tmp_path)
    assert not found["broken"]
    kinds = ["free", "fixed support", "moving support"]
    shown = {
        f"{name} · {material} · {kinds[0 if k < 22 else k - 21]}"
        for k, (name, material) in enumerate(zip(HOSTILE, materials, strict=True))
    }
    assert set(found["tips"]) == shown
    assert as_shown(found["title"]) == as_shown(case)
    assert found["heading"] == case
    assert found["case"] == case
    for name in HOSTILE[:-1]:
        assert as_shown(name) in as_shown(found["summary"]), name
    # Not one element more than with harmless names.
    assert found["kinds"] == plain(tmp_path)["kinds"]


@browser
@pytest.mark.parametrize(
    ("there", "put"),
    [
        ("<h1>plain</h1>", f"<h1>{HOSTILE[3]}</h1>"),
        ('"block 7"', f'"{HOSTILE[1]}"'),
        ("tip.textContent = blockText(b)", "tip.innerHTML = `<b>x</b>${blockText(b)}`"),
    ],
)
def test_the_probe_notices_what_does_run(tmp_path, there, put):
    response = named([f"block {k}" for k in range(24)], ["stone"] * 24)
    text = report_of(response, "case", title="plain")
    assert there in text
    page = tmp_path / "broken.html"
    page.write_text(text.replace(there, put), encoding="utf-8")
    assert seen(page, tmp_path, quiet=False)["broken"]


FRAGMENTS = st.one_of(
    st.sampled_from(
        [*HOSTILE, "<", ">", "</", "'", '"', "&", "\\", "/", "\u2028", "\u2029", "\u00a0", "\ufeff", "\u0085"]
    ),
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0\r"), max_size=6),
)
NAMES = st.lists(st.lists(FRAGMENTS, min_size=1, max_size=4).map("".join), min_size=24, max_size=24, unique=True)


@browser
@settings(
    max_examples=2,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(names=NAMES, materials=NAMES)
def test_names_of_any_kind_are_shown_as_they_are(tmp_path_factory, names, materials):
    tmp_path = tmp_path_factory.mktemp("names")
    found = seen(write_report(named(names, materials), tmp_path / "report.html", "x" + "".join(names)), tmp_path)
    assert not found["broken"]
    told = [f"{name} · {material}" if material else name for name, material in zip(names, materials, strict=True)]
    assert {tip.rpartition(" · ")[0] for tip in found["tips"]} == {text.split("\ndisplacement ")[0] for text in told}
    assert found["case"] == "x" + "".join(names)


@browser
def test_hostile_files_from_the_command_line_to_the_browser(tmp_path):
    """Block, group, material, support, case and layout file, with the real reading, solving and writing in between."""
    bodies = {HOSTILE[3]: [0.0, 0.0], HOSTILE[4]: [1.0, 0.5], HOSTILE[8].replace("/", ""): [3.0, 4.0]}
    square = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]]
    blocks = [
        {
            "name": name,
            "outline": [[x + a, y + b] for a, b in square],
            "group": HOSTILE[12 + k],
            "material": HOSTILE[19 + k],
        }
        for k, (name, (x, y)) in enumerate(bodies.items())
    ]
    layout = tmp_path / f"{HOSTILE[3]}.json"
    layout.write_text(
        json.dumps({"format": "blockvis layout", "version": 1, "unit": "m", "blocks": blocks}), encoding="utf-8"
    )

    def quoted(text):
        return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")

    text = f"""# {HOSTILE[1]}
[geometry]
file = {quoted(layout.name)}
[materials.{quoted(HOSTILE[19])}]
density = 1800.0
[[supports]]
name = {quoted(HOSTILE[1])}
role = "moving"
outline = [[-1.0, -0.5], [3.0, -0.5], [3.0, 0.0], [-1.0, 0.0]]
[settlement]
direction = [0.0, -1.0]
increment = 0.01
limit = 0.01
[output]
animation = false
"""
    case = tmp_path / f"{HOSTILE[15].replace('/', '')}.toml"
    case.write_text(text, encoding="utf-8")
    run = blockvis.run_case(case, tmp_path / "out")
    # The block in the air falls: a message names it.
    assert run.summary["status"] == "no initial equilibrium"
    found = seen(run.folder / "report.html", tmp_path)
    assert not found["broken"]
    names = [*bodies, HOSTILE[1]]
    for name in names:
        assert any(tip.startswith(f"{name} · ") for tip in found["tips"]), name
    assert as_shown(f"'{names[2]}'") in as_shown(found["summary"])
    assert found["case"] == text
