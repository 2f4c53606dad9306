"""What falls: a brick that drops is not the collapse of a wall, and every output says which of the two it was."""

import json
import re

import numpy as np
import pytest
from PIL import Image
from structures import alike, arch_response, dropped_brick, pixels, report_of

import blockvis
import solver
from blockvis import draw_curve
from blockvis.cli import _in_words, main


@pytest.mark.slow
def test_summary_console_report_and_curve_tell_them_apart(tmp_path):
    response = dropped_brick()
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "collapsed"
    assert summary["loss"] == "local"
    assert summary["falling_weight"] == pytest.approx(1962, abs=1)
    assert summary["falling_share"] == pytest.approx(0.01235, abs=1e-5)
    assert "local loss, the structure stands: 1.962 kN fall, 1.23 % of the weight" in _in_words(response, tmp_path)
    whole = _in_words(arch_response(), tmp_path)
    assert "collapse of the structure: 9.14 kN fall, 100 %" in whole
    assert "local loss" not in whole
    page = report_of(response)
    assert "<h1>Local loss at a settlement of" in page
    assert "1.962 kN = 0.0123 W, a local loss" in page
    said = re.findall(r"<!-- (.*?) -->", draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8"))
    assert any(line.startswith("local loss at ") for line in said)
    other = json.loads(
        (blockvis.write(arch_response(), tmp_path / "arch") / "summary.json").read_text(encoding="utf-8")
    )
    assert (other["loss"], other["falling_share"]) == ("structure", pytest.approx(1.0))


@pytest.mark.slow
def test_a_loss_is_in_every_output_and_told_apart(tmp_path):
    response = dropped_brick(0.05)
    assert response.stop is solver.Status.LIMIT_REACHED
    out = blockvis.write(response, tmp_path / "out")
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    (loss,) = summary["losses"]
    assert (loss["blocks"], loss["weight"]) == (["brick"], pytest.approx(1962, abs=1))
    assert loss["settlement"] == pytest.approx(response.losses[0].settlement)
    (line,) = (line for line in _in_words(response, tmp_path).splitlines() if line.startswith("loss: "))
    assert re.fullmatch(r"loss: brick at 0\.15\d+ m, 1\.962 kN, 1\.2 % of the weight; the structure stands .*", line)
    page = report_of(response)
    assert "the structure stands without" in page
    assert "<td>limit reached, 1 block lost</td>" in page
    assert "<td>motion that would follow</td><td>of supports alone</td>" in page
    assert re.search(
        r"<h1>Part has fallen: 1 block at a settlement of 0\.15\d+ m; the rest stands at the end</h1>", page
    )
    assert blockvis.open_results(out).losses == response.losses, "the files keep what fell"
    blocks = response.mesh(len(response.path) - 1)
    assert blocks.cell_data["fallen"].tolist() == [0, 1, 0, 0]
    for name, number in (("first", 0), ("last", -1)):
        still = pixels(blockvis.draw_still(response, number, path=tmp_path / f"{name}.png"))
        # On the stone, and in the legend below it.
        for part in (still[:-100], still[-100:]):
            assert bool(alike(part, (247, 205, 198), 3).any()) == (number != 0)
    pictures = []
    for number in ("0", "-1"):
        assert main(["render", str(out), "--cracks", number]) == 0
        with Image.open(out / "cracks.png") as picture:
            # Below the caption.
            pictures.append(np.asarray(picture.convert("L"))[100:])
    whole, left = ((picture < 255).sum() for picture in pictures)
    assert left < whole, "a stone that is lost leaves a hole in the survey of cracks"


@pytest.mark.slow
def test_the_curve_marks_where_blocks_are_lost(tmp_path):
    response = dropped_brick(0.05)
    said = draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")
    assert "<!-- 1 block lost -->" in said
    assert "lost" not in draw_curve(arch_response(), tmp_path / "arch.svg").read_text(encoding="utf-8")
    model = json.loads(re.search(r'id="model" type="application/json">(.*?)</script>', report_of(response)).group(1))
    ((row, place),) = model["curve"]["losses"]
    assert place == pytest.approx(response.losses[0].settlement, rel=1e-6)
    assert response.path[row - 1].parameter < place < response.path[row].parameter
    lost = [frame["lost"] for frame in model["frames"]]
    assert lost == [[]] * row + [[1]] * (len(lost) - row)
    assert "1 block lost" in model["frames"][-1]["caption"]
    assert "1 block lost" not in model["frames"][0]["caption"]
