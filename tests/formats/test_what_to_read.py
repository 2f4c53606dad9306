"""What of a drawing is read: repaired, left out, and chosen by window, kind and colour."""

import ezdxf
import pytest

from blockvis.cli import main


def drawn(path, *rings, **attributes):
    """Write a drawing of closed outlines in m."""
    document = ezdxf.new("R2000")
    document.header["$INSUNITS"] = 6
    for ring in rings:
        document.modelspace().add_lwpolyline(ring, close=True, dxfattribs=attributes)
    document.saveas(path)
    return document


def brick(x, y, length=1.0, height=0.5):
    return [(x, y), (x + length, y), (x + length, y + height), (x, y + height)]


def info(capsys, *arguments):
    """What ``blockvis info`` prints, or its refusal."""
    code = main(["info", *map(str, arguments)])
    said = capsys.readouterr()
    return said.out if code == 0 else said.err


def test_an_outline_that_crosses_itself_keeps_its_largest_piece_or_is_left_out(tmp_path, capsys):
    spur = [(1, 0), (2, 0), (2, 0.5), (1.001, 0.5), (1, 0.5), (1.01, 0.51)]
    bow = [(2, 0), (3, 0.5), (3, 0), (2, 0.5)]
    drawn(tmp_path / "wall.dxf", brick(0, 0), spur, bow, brick(0, 0.5, 3.0))
    said = info(capsys, tmp_path / "wall.dxf")
    assert "outlines        3" in said
    assert "repaired: 1 outline crosses or touches itself, 'block 30' at (1.0098, 0.5)" in said
    assert "left out: 1 outline that crosses itself on layer '0', 'block 31' at (2.5, 0.25)" in said


def test_a_background_alone_is_no_block(tmp_path, capsys):
    stones = "".join(f"M{x} 40h80v60h-80z" for x in (40, 140, 240))
    (tmp_path / "pile.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><rect id="sheet" width="512" height="512"/>'
        f'<path id="pile" d="M20 20h400v300h-400z{stones}"/></svg>'
    )
    assert "nothing but a background is left, 'sheet': <path> 'pile' has a hole" in info(capsys, tmp_path / "pile.svg")


@pytest.mark.parametrize(("gap", "says"), [(1.7e-5, "3 gaps of up to 2e-05 m are the rounding"), (0.01, "= 0.01 ")])
def test_only_gaps_that_are_joints_are_proposed_as_such(tmp_path, capsys, gap, says):
    drawn(tmp_path / "wall.dxf", *(brick(k * (1.0 + gap), 0.0) for k in range(4)))
    assert says in info(capsys, tmp_path / "wall.dxf")
