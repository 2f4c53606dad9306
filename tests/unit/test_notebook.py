"""What a notebook shows of a response, a collapse and an assembly."""

import base64
import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import blockvis
import solver
from blockvis import generators


def test_response_plots_itself_once_blockvis_is_imported():
    spread = solver.Settlement(direction=(1, 0), increment=0.05, limit=0.05)
    response = solver.settle(generators.arch(voussoirs=5), spread)
    shown = response.plot()._repr_html_()
    # What was never written is dated when it is shown: a second may pass between the two.
    dated = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC"
    assert re.sub(dated, "", shown) == re.sub(dated, "", blockvis.show(response)._repr_html_())
    assert re.search(dated, shown)
    assert "iframe" in shown
    assert "voussoir 1" not in shown.split("srcdoc")[0]


@pytest.mark.slow
def test_a_response_is_shown_by_its_pictures_and_numbers(arch):
    shown = arch._repr_html_()
    pictures = [base64.b64decode(data) for data in re.findall(r"base64,([A-Za-z0-9+/=]+)", shown)]
    sizes = [Image.open(io.BytesIO(picture)).size for picture in pictures]
    assert np.prod(sizes[0]) == pytest.approx(1280 * 720, rel=5e-3)
    assert [int(width) for width in re.findall(r'width="(\d+)"', shown)] == [width // 2 for width, _ in sizes]
    assert len(sizes) == 2, "the mechanism and the curve"
    assert all(np.ptp(np.asarray(Image.open(io.BytesIO(picture)))) > 100 for picture in pictures), "something is drawn"
    assert f"{arch.collapse.displacement:.6g} m" in shown
    assert "array(" not in shown


def test_a_response_without_increments_is_shown_by_its_message():
    assembly = generators.arch(voussoirs=5)
    empty = solver.Response(
        assembly,
        (),
        solver.Interfaces(),
        solver.self_weight(assembly),
        (),
        solver.Status.SOLVER_FAILED,
        "why & <how>",
    )
    assert "why &amp; &lt;how&gt;" in empty._repr_html_()


def test_a_collapse_is_shown_by_its_numbers(arch):
    shown = ElementTree.fromstring(arch.collapse._repr_html_())
    rows = {row[0].text: row[1].text for row in shown.iter("tr")}
    low, high = arch.collapse.bracket
    assert rows["equilibrium at"] == f"{low:.6g} m"
    assert rows["no equilibrium at"] == f"{high:.6g} m"
    assert rows["mechanism"] == arch.collapse.words


def test_an_assembly_is_shown_block_by_block():
    block = np.array([[0, 0], [2, 0], [2, 1], [0, 1]])
    assembly = solver.Assembly.from_outlines(
        [block, block + np.array([0, 1])],
        names=["ground", "a < b"],
        roles=["moving", "free"],
        density=2000.0,
        thickness=0.5,
    )
    shown = ElementTree.fromstring(assembly._repr_html_())
    svg = "{http://www.w3.org/2000/svg}"
    polygons = list(shown.iter(f"{svg}polygon"))
    assert [polygon.find(f"{svg}title").text for polygon in polygons] == ["ground", "a < b"]
    # 2 m are as wide as the picture; the upper block is above, where y is less.
    assert polygons[0].get("points") == "0.00,420.00 420.00,420.00 420.00,210.00 0.00,210.00"
    assert polygons[1].get("points").startswith("0.00,210.00")
    rows = {row[0].text: row[1].text for row in shown.iter("tr")}
    assert rows["blocks"] == "2: 1 free, 1 moving"
    assert rows["weight"] == "19.62 kN"


@pytest.mark.thorough
def test_limit_loads_are_shown_and_written_as_responses_are(tmp_path):
    """A limit load and an envelope ended in an AttributeError where only some of the functions knew them."""
    arch = solver.Structure(generators.arch(voussoirs=4), friction_coefficient=0.7)
    limit = arch.limit_load(acceleration=(1, 0))
    envelope = arch.envelope([0.1, 0.3], lambda x: solver.force_on_top(arch.assembly, x, (0, -100)))
    for name, result, count in (("limit", limit, 1), ("envelope", envelope, 2)):
        again = blockvis.open_results(blockvis.write(result, tmp_path / name))
        assert again.load_multiplier == pytest.approx(result.response.load_multiplier)
        assert len(again.path) == count
        assert "data:image/png" in result._repr_html_()
        assert "load multiplier" in blockvis.show(result)._repr_html_()
        assert Image.open(blockvis.draw_still(result, -1, tmp_path / f"{name}.png", size=(320, 240))).width == 320
        assert len(list(blockvis.animate(result, tmp_path / f"{name} film", size=(320, 240), fps=2).iterdir())) > 2
    for make in (blockvis.write, blockvis.animate, blockvis.draw_curve, blockvis.draw_mechanism, blockvis.write_report):
        with pytest.raises(
            TypeError, match="Assembly is no response; give what settle, pushover or limit_load returns"
        ):
            make(arch.assembly, tmp_path / "x.png" if make is not blockvis.write_report else tmp_path / "x.html")
    with pytest.raises(TypeError, match="NoneType is no response"):
        blockvis.show(None)
    with pytest.raises(TypeError, match=r"the increment is 'x\.png'; give its number, 0 to 0, or -1 for the last"):
        blockvis.draw_still(limit, "x.png", 0)
