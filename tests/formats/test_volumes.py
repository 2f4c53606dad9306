"""Meshes of volumes: the skin of each body is found, bodies that share nodes are kept apart."""

import meshio
import numpy as np
import pytest
import pyvista as pv

from blockvis import read, read_layout

#: Corners of a cube in the numbering of gmsh, and the tetrahedra, wedges and pyramids that fill it.
CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
FILLINGS = {
    "tetra": [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]],
    "hexahedron": [list(range(8))],
    "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
}


def bricks(kind, n=3, height=0.5):
    """Points and cells of bricks 1 × 0.25 × height in a row, every other one half a brick higher, nodes shared."""
    points, cells, owner = [], [], []
    number: dict[tuple[float, ...], int] = {}
    for k in range(n):
        for cell in FILLINGS[kind]:
            row = []
            for corner in cell:
                at = tuple((CUBE[corner] * (1.0, 0.25, height) + (k, 0.0, 0.5 * height * (k % 2))).tolist())
                if at not in number:
                    number[at] = len(points)
                    points.append(at)
                row.append(number[at])
            cells.append(row)
            owner.append(k + 1)
    return np.array(points), np.array(cells), np.array(owner)


def msh(path, kind, binary=False, version="2.2"):
    points, cells, owner = bricks(kind)
    mesh = meshio.Mesh(
        points,
        [(kind, cells)],
        cell_data={"gmsh:physical": [10 + (owner > 1)], "gmsh:geometrical": [owner]},
        field_data={"pier": np.array([10, 3]), "wall": np.array([11, 3])},
    )
    meshio.gmsh.write(path, mesh, fmt_version=version, binary=binary)
    return path


@pytest.mark.parametrize("kind", list(FILLINGS))
@pytest.mark.parametrize("binary", [False, True])
def test_volumes_of_a_msh_are_blocks(tmp_path, kind, binary):
    path = msh(tmp_path / "a.msh", kind, binary)
    layout = read_layout(path)
    assert layout.names == ("pier", "wall 1", "wall 2")
    assert layout.groups == layout.materials == ("pier", "wall", "wall")
    assert layout.thickness == pytest.approx([0.25] * 3)
    assert read(path).areas == pytest.approx([0.5] * 3)
    assert read(path, roles={"pier": "fixed"}).roles.tolist() == ["fixed", "free", "free"]
    assert all(len(ring) == 4 for ring in layout.outlines)


def test_version_41_and_the_skin_beside_the_volumes(tmp_path):
    points, cells, _ = bricks("tetra", n=1)
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '3 7 "pier"', "$EndPhysicalNames"]
    lines += ["$Entities", "0 0 1 1", "1 0 0 0 1 0.25 0.5 0 0", "1 0 0 0 1 0.25 0.5 1 7 0", "$EndEntities"]
    lines += ["$Nodes", "1 8 1 8", "3 1 0 8", *(str(k + 1) for k in range(8))]
    lines += [" ".join(map(str, point)) for point in points.tolist()]
    lines += ["$EndNodes", "$Elements", "2 6 1 6", "2 1 2 1", "1 1 2 4", "3 1 4 5"]
    lines += [" ".join(map(str, [k + 2, *(cell + 1)])) for k, cell in enumerate(cells)]
    (tmp_path / "a.msh").write_text("\n".join([*lines, "$EndElements", ""]), encoding="utf-8")
    layout = read_layout(tmp_path / "a.msh")
    assert layout.names == ("pier",)
    assert layout.groups == ("pier",)
    assert read(tmp_path / "a.msh", view="xz").areas == pytest.approx([0.5])


def test_pieces_of_one_volume_are_bodies_of_their_own(tmp_path):
    points, cells, _ = bricks("hexahedron")
    apart = np.concatenate([points, points + np.array([10.0, 0.0, 0.0])])
    both = np.concatenate([cells, cells + len(points)])
    ones = np.ones(6, dtype=int)
    mesh = meshio.Mesh(apart, [("hexahedron", both)], cell_data={"gmsh:physical": [ones], "gmsh:geometrical": [ones]})
    meshio.gmsh.write(tmp_path / "a.msh", mesh, fmt_version="2.2", binary=False)
    layout = read_layout(tmp_path / "a.msh")
    # Bricks half a brick higher than their neighbours share no face with them.
    assert layout.n_blocks == 6
    assert any("6 bodies, the pieces of 1 meshed volume" in note for note in layout.notes)


def test_a_volume_in_two_groups_is_refused(tmp_path):
    points, cells, _ = bricks("hexahedron", n=1)
    mesh = meshio.Mesh(
        points,
        [("hexahedron", np.concatenate([cells, cells]))],
        cell_data={"gmsh:physical": [np.array([1, 2])], "gmsh:geometrical": [np.array([5, 5])]},
        field_data={"a": np.array([1, 3]), "b": np.array([2, 3])},
    )
    meshio.gmsh.write(tmp_path / "a.msh", mesh, fmt_version="2.2", binary=False)
    with pytest.raises(ValueError, match="volume 5 is in 2 physical groups, 'a' and 'b'"):
        read(tmp_path / "a.msh")


@pytest.mark.parametrize("kind", list(FILLINGS))
def test_volumes_and_skin_of_a_vtu(tmp_path, kind):
    points, cells, owner = bricks(kind)
    skin = [[0, 1, 2]]
    vtk = {"tetra": pv.CellType.TETRA, "hexahedron": pv.CellType.HEXAHEDRON, "wedge": pv.CellType.WEDGE}[kind]
    grid = pv.UnstructuredGrid({vtk: cells, pv.CellType.TRIANGLE: np.array(skin)}, points)
    types = np.asarray(grid.celltypes)
    ids = np.zeros(len(types), dtype=int)
    ids[types == int(vtk)] = owner
    ids[types != int(vtk)] = 1
    grid.cell_data["block_id"] = ids
    grid.cell_data["material"] = np.where(ids > 1, "brick", "stone")
    grid.save(tmp_path / "a.vtu")
    layout = read_layout(tmp_path / "a.vtu")
    assert layout.names == ("block 1", "block 2", "block 3")
    assert layout.materials == ("stone", "brick", "brick")
    assert read(tmp_path / "a.vtu").areas == pytest.approx([0.5] * 3)
    assert layout.thickness == pytest.approx([0.25] * 3)
    assert not any("flat cell" in note for note in layout.notes)


@pytest.mark.parametrize("suffix", [".vtu", ".inp"])
def test_flat_cells_that_are_no_skin_are_counted(tmp_path, suffix):
    points, cells, _ = bricks("hexahedron")
    apart = points.max(axis=0) + np.array([[1, 0, 0], [2, 0, 0], [2, 0, 1], [1, 0, 1]])
    flat = np.array([[0, 1, 2, 3], [0, 1, 2, 3]]) + len(points)
    flat[0] = cells[0][:4]
    mesh = meshio.Mesh(np.concatenate([points, apart]), [("hexahedron", cells), ("quad", flat)])
    mesh.write(tmp_path / f"a{suffix}")
    layout = read_layout(tmp_path / f"a{suffix}")
    assert "left out: 1 flat cell beside bodies" in layout.notes


def test_flat_cells_without_points_are_none(tmp_path):
    points, cells, _ = bricks("hexahedron")
    hexahedra = np.insert(cells, 0, 8, axis=1).ravel()
    types = [pv.CellType.HEXAHEDRON] * len(cells) + [pv.CellType.POLYGON]
    pv.UnstructuredGrid(np.append(hexahedra, 0), types, points).save(tmp_path / "a.vtu")
    layout = read_layout(tmp_path / "a.vtu")
    assert layout.n_blocks == 3
    assert not any("flat cell" in note for note in layout.notes)


def test_stones_of_a_vtu_are_called_by_their_names(tmp_path):
    points, cells, _ = bricks("hexahedron", 4)
    grid = pv.UnstructuredGrid({pv.CellType.HEXAHEDRON: cells}, points)
    grid.cell_data["block_id"], grid.cell_data["name"] = np.array([1, 2, 3, 1]), ["pier", "key", "quoin", "pier"]
    grid.save(tmp_path / "a.vtu")
    assert read_layout(tmp_path / "a.vtu").names == ("pier 1", "pier 2", "key", "quoin")
    with pytest.raises(ValueError, match=r"'pier 1' lies behind 'quoin'"):
        read_layout(tmp_path / "a.vtu", view="yz")


def test_pieces_of_a_vtu_without_ids(tmp_path):
    points, cells, _ = bricks("tetra")
    pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points).save(tmp_path / "a.vtu")
    layout = read_layout(tmp_path / "a.vtu")
    assert layout.n_blocks == 3
    assert any("one block per piece that hangs together" in note for note in layout.notes)


def test_polyhedra_are_one_block_each(tmp_path):
    grid = polyhedra(3)
    grid.save(tmp_path / "a.vtu")
    layout = read_layout(tmp_path / "a.vtu")
    assert layout.n_blocks == 3
    assert layout.thickness == pytest.approx([0.25] * 3)
    assert any("read as outlines in xz" in note for note in layout.notes)


def polyhedra(n):
    """Hexahedra as cells of VTK that list their faces, as LMGC90 writes its bodies."""
    points, cells, _ = bricks("hexahedron", n)
    faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    stream = []
    for cell in cells:
        body = [len(faces)]
        for face in faces:
            body += [4, *cell[face].tolist()]
        stream += [len(body), *body]
    return pv.UnstructuredGrid(np.array(stream), np.full(n, 42, dtype=np.uint8), points)


def test_a_multiblock_with_centres_and_contacts_gives_its_bodies(tmp_path):
    grid = polyhedra(3)
    centres = pv.PolyData(grid.cell_centers().points)
    contact = pv.PolyData(np.array([[1, 0, 0.25], [1, 0.25, 0.25], [1, 0, 0.5]], dtype=float), faces=[3, 0, 1, 2])
    parts = pv.MultiBlock({"rigids": centres, "tacts": grid, "ptc": pv.Line(), "f2f": contact})
    parts.save(tmp_path / "a.vtm")
    text = (tmp_path / "a.vtm").read_text(encoding="utf-8")
    (tmp_path / "state_1.vtmb").write_text(text, encoding="utf-8")
    layout = read_layout(tmp_path / "state_1.vtmb")
    assert layout.n_blocks == 3
    assert any("left out: 'rigids', 'ptc', 'f2f', which draw no blocks" in note for note in layout.notes)


def test_volumes_that_meshio_reads(tmp_path):
    points, cells, owner = bricks("hexahedron")
    mesh = meshio.Mesh(points, [("hexahedron", cells)], cell_data={"medit:ref": [owner]})
    mesh.write(tmp_path / "a.mesh")
    assert read(tmp_path / "a.mesh").areas == pytest.approx([0.5] * 3)
    assert read_layout(tmp_path / "a.mesh").names == ("block 1", "block 2", "block 3")


def test_a_ball_of_tetrahedra_is_no_prism(tmp_path):
    pv.Sphere(theta_resolution=8, phi_resolution=8).delaunay_3d().save(tmp_path / "a.vtu")
    with pytest.raises(ValueError, match="is not prismatic: body 'block' is no extrusion along x, y or z"):
        read(tmp_path / "a.vtu", dimension=2)


def skin_of(box, path):
    """Triangles around a box as a mesh of surfaces, in the format of a suffix."""
    surface = pv.Box(box).triangulate()
    if path.suffix == ".msh":
        faces = surface.faces.reshape(-1, 4)[:, 1:]
        tags = np.arange(len(faces)) // 2 + 1
        data = {"gmsh:physical": [np.ones(len(faces), dtype=int)], "gmsh:geometrical": [tags]}
        meshio.gmsh.write(path, meshio.Mesh(surface.points, [("triangle", faces)], cell_data=data), "2.2", binary=False)
    else:
        surface.save(path)
    return path


@pytest.mark.parametrize("suffix", [".msh", ".vtp", ".vtk"])
def test_closed_surfaces_are_bodies(tmp_path, suffix):
    path = skin_of((0, 1, 0, 0.25, 0, 0.5), tmp_path / f"a{suffix}")
    layout = read_layout(path, view="xz")
    assert layout.thickness == pytest.approx([0.25])
    assert read(path, view="xz").areas == pytest.approx([0.5])
    assert any("one block per closed surface" in note for note in layout.notes)


@pytest.mark.parametrize("suffix", [".msh", ".vtp"])
def test_surfaces_that_enclose_nothing_are_not_flat(tmp_path, suffix):
    plate = pv.Plane(i_resolution=2, j_resolution=2).triangulate()
    plate.clear_data()
    plate.points[4, 2] = 0.01
    path = tmp_path / f"a{suffix}"
    if suffix == ".msh":
        pv.save_meshio(path, plate, file_format="gmsh22")
    else:
        plate.save(path)
    with pytest.raises(ValueError, match=r"is not flat: its points spread over 1 × 1 × 0.01"):
        read(path)


def test_damaged_cells_are_refused(tmp_path):
    grid = polyhedra(2)
    grid.save(tmp_path / "a.vtu", binary=False)
    text = (tmp_path / "a.vtu").read_text(encoding="utf-8")
    assert "0 3 2 1 4 5" in text
    (tmp_path / "a.vtu").write_text(text.replace("0 3 2 1 4 5", "0 3 99 1 4 5"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"a.vtu' has a damaged cell \(a face of a polyhedron uses a point"):
        read(tmp_path / "a.vtu")
    points, cells, _ = bricks("hexahedron", 2)
    pv.UnstructuredGrid({pv.CellType.HEXAHEDRON: cells}, points).save(tmp_path / "b.vtu", binary=False)
    text = (tmp_path / "b.vtu").read_text(encoding="utf-8")
    assert "0 1 2 3 4 5" in text
    (tmp_path / "b.vtu").write_text(text.replace("0 1 2 3 4 5", "0 1 2 3 4 55"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"b.vtu' has a damaged cell \(it uses a point that does not exist"):
        read(tmp_path / "b.vtu")


def test_an_array_that_announces_more_than_a_drawing_holds_is_refused(tmp_path):
    pv.Box((0, 1, 0, 0.25, 0, 0.5)).triangulate().save(tmp_path / "a.vtp")
    data = (tmp_path / "a.vtp").read_bytes()
    at = data.index(b'Name="connectivity"', data.index(b"<Polys>"))
    start = data.index(b">", at) + 1
    start += len(data[start:]) - len(data[start:].lstrip())
    assert data[start : start + 4] == b"AQAA"
    # The size of the only chunk, in base 64: 3.4 GB.
    (tmp_path / "a.vtp").write_bytes(data[: start + 5] + b"3" + data[start + 6 :])
    with pytest.raises(ValueError, match=r"announces \d{9,} items in \d+ bytes"):
        read(tmp_path / "a.vtp")
