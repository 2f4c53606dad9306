"""Meshes of gmsh: one surface, one block, groups by dimension and tag; and broken files."""

import struct
from pathlib import Path

import numpy as np
import pytest

from blockvis import read, read_layout

ASSETS = Path(__file__).parents[2] / "assets"


@pytest.fixture
def gmsh():
    """Gmsh's own library, to write and read what it does."""
    library = pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
    library.initialize(["gmsh", "-nopopup"], interruptible=False)
    library.option.setNumber("General.Terminal", 0)
    yield library
    library.finalize()


def quad(gmsh, x, y, w, h):
    return gmsh.model.occ.addRectangle(x, y, 0, w, h)


@pytest.mark.cad
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_versions(gmsh, tmp_path, version, binary, order):
    a, b, c = quad(gmsh, 0, 0, 2, 1), quad(gmsh, 2, 0, 2, 1), gmsh.model.occ.addDisk(6, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(1, [1], 7, "stone")
    gmsh.model.addPhysicalGroup(2, [a, b], 7, "stone")
    gmsh.model.addPhysicalGroup(2, [c], 8, "fixed")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    path = tmp_path / "a.msh"
    gmsh.write(str(path))
    drawing = read_layout(path)
    assert drawing.groups == ("stone", "stone", "fixed")
    assert drawing.names == ("stone 1", "stone 2", "fixed")
    assembly = read(path)
    assert assembly.roles.tolist() == ["free", "free", "fixed"]
    assert assembly.areas[:2] == pytest.approx([2, 2])
    assert len(assembly.outline(0)) == 4
    assert assembly.areas[2] == pytest.approx(np.pi, rel=0.05)


@pytest.mark.cad
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_partitions_are_no_blocks(gmsh, tmp_path, version, binary):
    parts, _ = gmsh.model.occ.fragment([(2, quad(gmsh, 0, 0, 2, 1))], [(2, quad(gmsh, 2, 0, 1, 1))])
    gmsh.model.occ.synchronize()
    for (_, tag), name in zip(parts, ("stone", "fixed"), strict=True):
        gmsh.model.addPhysicalGroup(2, [tag], name=name)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.partition(3)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(tmp_path / "a.msh"))
    drawing = read_layout(tmp_path / "a.msh")
    assert drawing.names == drawing.groups == ("stone", "fixed")
    assert read(tmp_path / "a.msh").areas == pytest.approx([2, 1])


@pytest.mark.cad
def test_a_surface_in_two_groups_is_refused(gmsh, tmp_path):
    a = quad(gmsh, 0, 0, 2, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [a], 1, "stone")
    gmsh.model.addPhysicalGroup(2, [a], 2, "left")
    gmsh.model.mesh.generate(2)
    for version in (2.2, 4.1):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        path = tmp_path / "a.msh"
        gmsh.write(str(path))
        with pytest.raises(ValueError, match="surface 1 is in 2 physical groups, 'stone' and 'left'"):
            read(path)


@pytest.mark.cad
def test_a_hole_is_refused(gmsh, tmp_path):
    outer, inner = quad(gmsh, 0, 0, 3, 3), quad(gmsh, 1, 1, 1, 1)
    gmsh.model.occ.cut([(2, outer)], [(2, inner)])
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)
    gmsh.write(str(tmp_path / "a.msh"))
    with pytest.raises(ValueError, match=r"has a hole around \(1.5, 1.5\)"):
        read(tmp_path / "a.msh")


@pytest.mark.cad
def test_no_surface_cells(gmsh, tmp_path):
    quad(gmsh, 0, 0, 3, 3)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(1)
    gmsh.write(str(tmp_path / "a.msh"))
    with pytest.raises(ValueError, match=r"has no surface cells: none of its \d+ elements is a triangle"):
        read(tmp_path / "a.msh")


@pytest.mark.cad
def test_gmsh_reads_what_we_write(gmsh, tmp_path):
    from blockvis import save_layout

    arch = read(ASSETS / "semicircular_arch.msh", roles={"right springer": "moving", "left springer": "fixed"})
    save_layout(arch, tmp_path / "a.msh")
    gmsh.open(str(tmp_path / "a.msh"))
    groups = {gmsh.model.getPhysicalName(*g): len(gmsh.model.getEntitiesForPhysicalGroup(*g)) for g in
              gmsh.model.getPhysicalGroups(2)}  # fmt: skip
    assert groups == {"voussoirs": 12, "moving": 1, "fixed": 1}


def test_the_arch_of_the_assets_is_exact():
    arch = read(ASSETS / "semicircular_arch.msh", roles={"right springer": "moving", "left springer": "fixed"})
    assert arch.n_blocks == 14
    assert np.diff(arch.offsets).tolist() == [4] * 14
    radii = np.hypot(*arch.vertices[arch.block_of_vertex < 12].T)
    assert np.minimum(np.abs(radii - 0.925), np.abs(radii - 1.075)).max() < 1e-15
    assert arch.roles[12:].tolist() == ["moving", "fixed"]


@pytest.mark.cad
def test_the_script_of_the_arch_gives_the_same_blocks():
    pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
    mesh, script = (read(ASSETS / f"semicircular_arch{suffix}") for suffix in (".msh", ".geo"))
    assert script.names == mesh.names
    assert np.allclose(script.centroids, mesh.centroids, rtol=0, atol=1e-12)
    assert np.allclose(script.areas, mesh.areas, rtol=1e-12)


def hostile(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "4.1 0 8",
            "5.0 0 8",
            r"is version 5.0 of .msh; versions 2 and 4.1 are read: gmsh old.msh -save -format msh41",
        ),
        ("$MeshFormat", "$Mesh", "is not a gmsh mesh: it has no section"),
        ("$Nodes\n70 56 1 56", "$Nodes\n99999999999 9 1 9", "is cut off: its section .Nodes|has no section"),
        ("0.925 0", "x.925 0", "holds something that is not a number"),
    ],
)
def test_broken_files(old, new, message, tmp_path):
    text = (ASSETS / "semicircular_arch.msh").read_text(encoding="utf-8")
    if old.startswith("$Nodes"):
        line = text[text.index("$Nodes") :].split("\n")[1]
        old = f"$Nodes\n{line}"
    (tmp_path / "a.msh").write_text(hostile(text, old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read(tmp_path / "a.msh")


def test_truncated_anywhere_is_refused_or_complete(tmp_path):
    data = (ASSETS / "semicircular_arch.msh").read_bytes()
    for length in range(0, len(data), 397):
        (tmp_path / "a.msh").write_bytes(data[:length])
        with pytest.raises(ValueError):
            read(tmp_path / "a.msh")


@pytest.mark.parametrize("header", [(2, 0, 2), (2, 1, -4)], ids=["no elements", "no tags"])
def test_headers_of_binary_elements_that_count_nothing_are_refused(header, tmp_path):
    path = tmp_path / "broken.msh"
    nodes = b"".join(struct.pack("<i3d", k, x, y, 0.0) for k, x, y in ((1, 0.0, 0.0), (2, 1.0, 0.0), (3, 0.0, 1.0)))
    path.write_bytes(
        b"$MeshFormat\n2.2 1 8\n\x01\x00\x00\x00\n$EndMeshFormat\n$Nodes\n3\n" + nodes + b"\n$EndNodes\n"
        b"$Elements\n1\n" + struct.pack("<3i", *header) + b"\n$EndElements\n"
    )
    with pytest.raises(ValueError, match=f"header of {header[1]} elements, {header[2]} tags"):
        read_layout(path)
