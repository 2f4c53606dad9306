"""Blocks in space as other programs write them: .glb, .step, .brep, .msh, .vtm, COMPAS, .obj and .stl by hand."""

import json

import numpy as np
import pytest
from structures import fans, layout_of

import solver
from blockvis import generators, inspect, read, read_layout

#: Faces of a box whose corners are numbered around its bottom, then around its top.
BOX = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


@pytest.fixture(scope="module")
def dome():
    """Four lunes of two stones under a cap."""
    return layout_of(generators.dome(lunes=4, courses=2))


def same(found, dome, scale=1.0):
    """Whether an assembly has the blocks of the dome, in any order."""
    assert found.dimension == 3
    assert found.n_blocks == dome.n_blocks
    assert np.sort(found.shapes.volumes) == pytest.approx(np.sort(dome.volumes) * scale**3, rel=1e-6)
    assert found.vertices.min(axis=0) == pytest.approx(dome.points.min(axis=0) * scale, abs=1e-6)
    assert found.vertices.max(axis=0) == pytest.approx(dome.points.max(axis=0) * scale, abs=1e-6)
    return True


def scene_of(dome):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    for (points, faces), name in zip(dome.solids, dome.names, strict=True):
        mesh = trimesh.Trimesh(points, fans(faces), process=False)
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    return scene


def test_a_glb_file_of_trimesh_has_z_up(dome, tmp_path):
    scene_of(dome).export(tmp_path / "dome.glb")
    assert same(read(tmp_path / "dome.glb", roles={"springer *": "fixed"}), dome)


def test_a_stone_of_several_materials_in_a_glb_file_is_one_body(tmp_path):
    """Its mesh has a primitive for each: here the front, then the rest."""
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    for k, name in enumerate(("fixed base", "stone")):
        scene.add_geometry(trimesh.creation.box(bounds=[[0, 0, k], [1, 1, k + 1]]), node_name=name, geom_name=name)

    def split(tree):
        (whole,), accessors = tree["meshes"][1]["primitives"], tree["accessors"]
        faces = accessors[whole["indices"]]
        assert (faces["componentType"], faces["count"]) == (5125, 36)
        accessors += [{**faces, "count": 12}, {**faces, "count": 24, "byteOffset": faces.get("byteOffset", 0) + 12 * 4}]
        tree["meshes"][1]["primitives"] = [{**whole, "indices": len(accessors) - k} for k in (2, 1)]
        # Its edges as a loop, which trimesh does not read, make one primitive of two.
        tree["meshes"][0]["primitives"].append({**tree["meshes"][0]["primitives"][0], "mode": 2})
        tree["nodes"] += [{"name": f"stone {k}", "mesh": 1, "translation": [0, 0, k]} for k in range(1, 8)]
        tree["nodes"].append({"name": "support", "mesh": 0, "translation": [0, 0, 9]})
        tree["scenes"][0]["nodes"] += range(2, len(tree["nodes"]))

    (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb", tree_postprocessor=split))
    assembly = read(tmp_path / "a.glb", dimension=3, view="xz")
    assert assembly.names == ("fixed base", "support", "stone", *(f"stone {k}" for k in range(1, 8)))
    np.testing.assert_allclose(assembly.centroids[:, 2], [0.5, 9.5, *np.arange(1.5, 9.0)])
    assert assembly.roles.tolist() == ["fixed"] * 2 + ["free"] * 8
    np.testing.assert_allclose(assembly.shapes.volumes, 1.0)


def test_a_node_of_a_glb_file_that_is_called_as_the_frame_of_trimesh_keeps_its_name(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene(trimesh.creation.box((1, 1, 1)))

    def renamed(tree):
        tree["nodes"][0]["name"] = "world"

    (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb", tree_postprocessor=renamed))
    assert read(tmp_path / "a.glb", dimension=3).names == ("world",)


def test_y_is_up_in_a_glb_file_of_other_programs(dome, tmp_path):
    data = (
        scene_of(dome)
        .apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
        .export(file_type="glb")
    )
    length = int.from_bytes(data[12:16], "little")
    head = json.loads(data[20 : 20 + length])
    head["asset"]["generator"] = "Khronos glTF Blender I/O v4.0"
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    (tmp_path / "dome.glb").write_bytes(
        data[:8]
        + (20 + len(text) + len(rest)).to_bytes(4, "little")
        + len(text).to_bytes(4, "little")
        + data[16:20]
        + text
        + rest
    )
    layout = read_layout(tmp_path / "dome.glb")
    assert any("y is up in .glb files (Khronos glTF Blender I/O v4.0)" in note for note in layout.notes)
    assert same(read(tmp_path / "dome.glb"), dome)
    upside = read(tmp_path / "dome.glb", view="xz", dimension=3)
    assert np.ptp(upside.vertices[:, 2]) == pytest.approx(np.ptp(dome.points[:, 1]))


def test_objects_of_an_obj_file_are_roles_by_name(tmp_path):
    lines, start = [], 1
    for name, z in (("support.001", -1.0), ("stone", 0.0), ("Moving left", 1.0)):
        lines.append(f"o {name}")
        for corner in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (0.9, 0, 1), (0.9, 1, 1), (0, 1, 1)]:
            lines.append(f"v {corner[0]} {corner[1]} {corner[2] + z}")
        lines += ["f " + " ".join(f"{start + k}//1" for k in ring) for ring in BOX]
        start += 8
    (tmp_path / "a.obj").write_text("\n".join(lines), encoding="utf-8")
    found = read(tmp_path / "a.obj", dimension=3)
    assert found.names == ("support.001", "stone", "Moving left")
    assert found.roles.tolist() == ["fixed", "free", "moving"]
    # A stack of prisms is in the plane unless space is asked for, with the same roles.
    assert inspect(tmp_path / "a.obj").roles == ("fixed", "free", "moving")


def test_one_stl_of_stones_that_stand_apart(dome, tmp_path):
    lines = []
    for k, (points, faces) in enumerate(dome.solids):
        away = points + 0.3 * k
        for triangle in away[fans(faces)]:
            lines += ["facet normal 0 0 0", "outer loop", *("vertex " + " ".join(map(str, p)) for p in triangle)]
            lines += ["endloop", "endfacet"]
    (tmp_path / "a.stl").write_text("\n".join(["solid all", *lines, "endsolid all"]), encoding="utf-8")
    assert read_layout(tmp_path / "a.stl").n_blocks == dome.n_blocks


def test_a_unit_and_its_doubt(dome, tmp_path):
    pytest.importorskip("trimesh")
    from blockvis import write_layout

    write_layout(dome, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text(encoding="utf-8").splitlines()
    grown = [
        "v " + " ".join(str(1e3 * float(x)) for x in line.split()[1:]) if line.startswith("v ") else line
        for line in text
    ]
    (tmp_path / "b.obj").write_text("\n".join(grown), encoding="utf-8")
    assert same(read(tmp_path / "b.obj", unit="mm"), dome)
    notes = read_layout(tmp_path / "b.obj").notes
    assert any("unit m in doubt: it makes the median block" in note and "--unit mm" in note for note in notes)


@pytest.mark.cad
def test_drums_of_a_column(tmp_path):
    """Round faces are strips from rim to rim; triangles across them made stones that seemed to cross themselves."""
    gmsh = pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
    gmsh.initialize(["gmsh", "-nopopup"], interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(-1000, -1000, -200, 2000, 2000, 200)
    for height in (0, 300, 600):
        gmsh.model.occ.addCylinder(0, 0, height, 0, 0, 300, 250)
    gmsh.model.occ.synchronize()
    gmsh.write(str(tmp_path / "a.step"))
    gmsh.finalize()
    found = read(tmp_path / "a.step")
    assert found.shapes.volumes[1:] == pytest.approx([0.3 * np.pi * 0.25**2] * 3, rel=0.015)
    column = found.with_roles(["fixed", "free", "free", "free"])
    live = solver.weight_fraction(column, (1.0, 0.0, 0.0), column.free)
    loads = solver.Loads(solver.self_weight(column).dead, live)
    pushed = solver.limit_load(column, friction_coefficient=0.9, loads=loads)
    assert pushed.multiplier == pytest.approx(0.5 / 0.9, rel=0.01)


@pytest.mark.cad
@pytest.mark.parametrize("suffix", [".step", pytest.param(".brep", marks=pytest.mark.slow), ".msh"])
def test_volumes_of_gmsh(suffix, tmp_path):
    gmsh = pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
    gmsh.initialize(["gmsh", "-nopopup"], interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    base = gmsh.model.occ.addBox(0, 0, 0, 2, 1, 0.5)
    wedge = gmsh.model.occ.addWedge(0, 0, 0.5, 1.0, 1.0, 0.5, ltx=0.6)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [base], name="fixed")
    gmsh.model.addPhysicalGroup(3, [wedge], name="stone")
    if suffix == ".msh":
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
        gmsh.model.mesh.generate(3)
    gmsh.write(str(tmp_path / f"a{suffix}"))
    gmsh.finalize()
    found = read(tmp_path / f"a{suffix}", unit="m", dimension=3)
    assert found.n_blocks == 2
    assert sorted(found.shapes.volumes) == pytest.approx([0.4, 1.0], rel=1e-6)
    assert np.bincount(found.shapes.block_of_face).tolist() == [6, 6]
    if suffix == ".msh":
        assert sorted(found.roles.tolist()) == ["fixed", "free"]


def test_parts_of_a_multiblock(dome, tmp_path):
    pv = pytest.importorskip("pyvista")
    parts = pv.MultiBlock()
    for (points, faces), name in zip(dome.solids, dome.names, strict=True):
        parts[name] = pv.PolyData(points, np.concatenate([[len(ring), *ring] for ring in faces]))
    parts.save(tmp_path / "dome.vtm")
    assert "one block per closed surface" in read_layout(tmp_path / "dome.vtm").notes
    found = read(tmp_path / "dome.vtm", roles={"springer *": "moving"})
    assert same(found, dome)
    assert sorted(found.names) == sorted(dome.names)
    assert int(found.moving.sum()) == 4


def compas_mesh(points, faces, name):
    return {
        "dtype": "compas.datastructures/Mesh",
        "data": {
            "attributes": {"name": name},
            "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "vertex": {str(k): dict(zip("xyz", map(float, p), strict=True)) for k, p in enumerate(points)},
            "face": {str(k): list(ring) for k, ring in enumerate(faces)},
            "facedata": {},
            "edgedata": {},
        },
    }


def test_an_assembly_and_polyhedra_of_compas(dome, tmp_path):
    node = {
        str(k): {"block": compas_mesh(*solid, name), "is_support": name.startswith("springer")}
        for k, (solid, name) in enumerate(zip(dome.solids, dome.names, strict=True))
    }
    graph = {"dtype": "compas.datastructures/Graph", "data": {"default_node_attributes": {}, "node": node, "edge": {}}}
    assembly = {"dtype": "compas_assembly.datastructures/Assembly", "data": {"attributes": {}, "graph": graph}}
    (tmp_path / "a.json").write_text(json.dumps(assembly), encoding="utf-8")
    found = read(tmp_path / "a.json")
    assert same(found, dome)
    assert found.roles.tolist() == ["free"] * 9 + ["fixed"] * 4
    polyhedra = [
        {"dtype": "compas.geometry/Polyhedron", "data": {"vertices": points.tolist(), "faces": faces}}
        for points, faces in dome.solids
    ]
    (tmp_path / "b.json").write_text(json.dumps(polyhedra), encoding="utf-8")
    found = read(tmp_path / "b.json", roles={"block 9": "fixed", "block 1[012]": "moving"})
    assert same(found, dome)
    assert found.roles.tolist()[-4:] == ["fixed", "moving", "moving", "moving"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"points": [[0, 0, 0]] * 8}, r"block 0 \('a'\) .* it is a sheet, not a block"),
        ({"faces": [[0, 1, 99], *BOX]}, "block 'a' is no closed block: a face uses point 99 of 8; repair it"),
        ({"faces": BOX[:3]}, "block 'a' is no closed block: it has 3 faces; repair it"),
        ({"faces": BOX[:5]}, "block 'a': the surface is not closed"),
        ({"points": None}, "block 'a' has no points"),
        ({"faces": [[0, 1, float("inf")], *BOX]}, r"block 'a' has no points \[\[x, y, z\], ...\] and faces"),
        ({"role": "fix"}, "has role 'fix'"),
    ],
)
def test_damaged_layouts_are_refused_by_name(change, reason, tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    block = {"name": "a", "points": points, "faces": BOX} | change
    (tmp_path / "a.json").write_text(json.dumps({"format": "blockvis layout", "blocks": [block]}), encoding="utf-8")
    with pytest.raises(ValueError, match=reason):
        read(tmp_path / "a.json")


def test_nodes_of_a_glb_file_name_the_stones_that_share_a_mesh(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    scene = trimesh.Scene({"Cube": box})
    scene.graph.clear()
    for level, name in enumerate(("support base", "lower", "upper")):
        place = trimesh.transformations.translation_matrix((0.0, 0.0, level))
        scene.graph.update(frame_to=name, matrix=place, geometry="Cube")
    scene.export(tmp_path / "tower.glb")
    found = read(tmp_path / "tower.glb", dimension=3)
    assert {name: z for name, (_, _, z) in zip(found.names, found.centroids.round(6).tolist(), strict=True)} == {
        "support base": 0.0, "lower": 1.0, "upper": 2.0,
    }  # fmt: skip
    assert found.roles[found.index("support base")] == "fixed"


@pytest.mark.parametrize("turned", [[0], [0, 3, 7], [1, 2, 4, 5, 8, 11], list(range(12))])
def test_triangles_of_a_stone_may_be_seen_from_either_side(tmp_path, turned):
    trimesh = pytest.importorskip("trimesh")
    lower, upper = trimesh.creation.box((1.0, 2.0, 0.5)), trimesh.creation.box((1.0, 2.0, 0.5))
    upper.apply_translation((0.0, 0.0, 0.5))
    faces = upper.faces.copy()
    faces[turned] = faces[turned, ::-1]
    upper = trimesh.Trimesh(upper.vertices, faces, process=False)
    trimesh.Scene({"lower": lower, "upper": upper}).export(tmp_path / "tower.obj")
    layout = read_layout(tmp_path / "tower.obj", dimension=3)
    assert layout.volumes == pytest.approx([1.0, 1.0])
    assert read(tmp_path / "tower.obj", roles={"lower": "fixed"}, dimension=3).shapes.volumes == pytest.approx(
        [1.0, 1.0]
    )


def test_of_two_copies_that_with_a_role_stays(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    low, high = trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((1.0, 1.0, 1.0))
    high.apply_translation((0.0, 0.0, 1.0))
    trimesh.Scene({"copy": low, "base": low.copy(), "stone": high}).export(tmp_path / "tower.obj")
    with pytest.warns(UserWarning, match="1 of 3 blocks is drawn twice and was dropped: 'copy' = 'base'"):
        found = read(tmp_path / "tower.obj", roles={"base": "fixed"}, dimension=3)
    assert sorted(found.names) == ["base", "stone"]
    with pytest.warns(UserWarning, match="'base' = 'copy'|'copy' = 'base'"):
        assert read(tmp_path / "tower.obj", dimension=3).n_blocks == 2


@pytest.mark.parametrize(("sides", "told"), [(24, False), (96, True)])
def test_a_round_stone_that_loses_volume_is_noted(tmp_path, sides, told):
    trimesh = pytest.importorskip("trimesh")
    drum = trimesh.creation.cylinder(0.25, 0.3, sections=sides)
    trimesh.Scene({"drum": drum}).export(tmp_path / "drum.obj")
    layout = read_layout(tmp_path / "drum.obj", dimension=3)
    noted = [note for note in layout.notes if "the volume of 1 of 1 blocks is off by up to -" in note]
    assert bool(noted) == told
    assert (abs(layout.volumes[0] / drum.volume - 1.0) > 1e-3) == told
