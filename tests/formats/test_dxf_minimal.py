"""DXF as drawing programs other than ezdxf export it: R12 text without header or tables, POLYLINE and LINE entities."""

import pytest

from blockvis import read_layout


def _entity(kind, layer, *pairs):
    return f"0\n{kind}\n8\n{layer}\n" + "".join(f"{code}\n{value}\n" for code, value in pairs)


def _file(*entities):
    return "0\nSECTION\n2\nENTITIES\n" + "".join(entities) + "0\nENDSEC\n0\nEOF\n"


def _polyline(layer, corners):
    vertices = "".join(_entity("VERTEX", layer, (10, x), (20, y), (30, 0.0)) for x, y in corners)
    return _entity("POLYLINE", layer, (66, 1), (70, 1)) + vertices + _entity("SEQEND", layer)


def test_polylines_and_loose_lines_of_a_bare_r12_file(tmp_path):
    ring = [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)]
    lines = [
        _entity("LINE", "loose", (10, a[0]), (20, a[1]), (11, b[0]), (21, b[1]))
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True)
    ]
    path = tmp_path / "bare.dxf"
    path.write_text(_file(_polyline("bricks", [(0, 0), (1, 0), (1, 1), (0, 1)]), *lines), encoding="ascii")
    drawing = read_layout(path, unit="m")
    assert sorted(drawing.groups) == ["bricks", "loose"]
    assert sorted(outline[:, 0].min() for outline in drawing.outlines) == pytest.approx([0.0, 1.0])
