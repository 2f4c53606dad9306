"""Files of COMPAS: assemblies of its several versions, block models, lists of meshes, boxes."""

import json

import numpy as np
import pytest

from blockvis import read, read_layout
from blockvis.cli import main

FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]

#: Lower corner and size of a pier, its twin and the lintel on both; the pier stands at the origin, where COMPAS leaves
#: out coordinates that are the default.
TRILITHON = {
    "pier": ((0, 0, 0), (0.5, 0.4, 1)),
    "twin": ((1.5, 0, 0), (0.5, 0.4, 1)),
    "lintel": ((0, 0, 1), (2, 0.4, 0.5)),
}


def corners(at, size):
    unit = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    return (np.array(unit) * size + at).tolist()


def mesh(name, at, size, *, text_keys=False, default="default_vertex_attributes", faces=FACES):
    """The data of a mesh, without the coordinates that are the default."""
    vertex = {
        str(k): {axis: value for axis, value in zip("xyz", point, strict=True) if value}
        for k, point in enumerate(corners(at, size))
    }
    face = {str(k): [str(v) for v in ring] if text_keys else ring for k, ring in enumerate(faces)}
    return {
        "attributes": {"name": name},
        default: {"x": 0.0, "y": 0.0, "z": 0.0},
        "vertex": vertex,
        "face": face,
        "facedata": {str(k): {} for k in range(6)},
        "edgedata": {},
    }


def parts(**options):
    return [mesh(name, *box, **options) for name, box in TRILITHON.items()]


def before_1_0():
    """Blocks apart from the nodes of the assembly, numbers as texts."""
    nodes = {str(k): {"x": 1.0} for k in range(3)}
    nodes["0"]["is_support"] = nodes["1"]["is_support"] = True
    blocks = {str(k): part for k, part in enumerate(parts(text_keys=True, default="dva"))}
    graph = {"attributes": {"name": "Assembly"}, "node_attributes": {"is_support": False}, "node": nodes, "edge": {}}
    return {"assembly": graph, "blocks": blocks}


def version_1():
    """A graph whose nodes hold blocks, their data under "value"."""
    node = {
        str(k): {
            "block": {"dtype": "compas_assembly.datastructures/Block", "value": part, "guid": f"{k}"},
            "is_support": k < 2,
        }
        for k, part in enumerate(parts(default="dva"))
    }
    interface = {"dtype": "compas_assembly.datastructures/Interface", "value": {"mesh": parts()[0]}}
    return {"graph": {"dna": {"block": None}, "node": node, "edge": {"0": {"2": {"interface": interface}}}}}


def version_2():
    """The same, wrapped once more, the data under "data"."""
    node = {
        str(k): {"block": {"dtype": "compas_assembly.datastructures/Block", "data": part, "name": "Mesh"}}
        for k, part in enumerate(parts())
    }
    node["2"]["is_support"] = False
    graph = {"default_node_attributes": {"is_support": True}, "node": node, "edge": {}}
    wrapped = {"dtype": "compas.datastructures/Graph", "data": graph}
    return {"dtype": "compas_assembly.datastructures/Assembly", "data": {"attributes": {}, "graph": wrapped}}


def assembly_of_parts():
    """An assembly of COMPAS itself: its nodes hold parts, and these the meshes, in place."""
    node = {}
    for k, part in enumerate(parts()):
        geometry = {"dtype": "compas.datastructures/Mesh", "data": part, "name": part["attributes"]["name"]}
        attributes = {"name": part["attributes"]["name"], "is_support": k < 2, "geometry": geometry}
        data = {"attributes": attributes, "key": k, "features": []}
        node[str(k)] = {"part": {"dtype": "compas.datastructures/Part", "data": data}}
    graph = {"default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0}, "node": node, "edge": {}}
    return {"dtype": "compas.datastructures/Assembly", "data": {"graph": graph, "attributes": {"name": "Assembly"}}}


def element(k, part, **more):
    geometry = {"dtype": "compas.datastructures/Mesh", "data": part, "guid": f"mesh {k}"}
    data = {"transformation": None, "features": [], "name": "Block", "geometry": geometry, "is_support": k < 2, **more}
    return {"dtype": "compas_dem.elements/Block", "data": data, "guid": f"e{k}"}


def moved(x, y, z):
    matrix = [[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]]
    return {"dtype": "compas.geometry/Translation", "data": {"matrix": matrix}}


def block_model(as_list=False):
    """A model of compas_dem: elements by their number, materials, a tree with the lintel below the first pier."""
    elements = [element(k, part, material="m") for k, part in enumerate(parts())]
    lintel = mesh("lintel", (0, 0, 0), (2, 0.4, 0.5))
    elements[2] = element(2, lintel, material=None, transformation=moved(-7, 0, 1))
    elements[0]["data"]["geometry"]["data"] = mesh("pier", (-7, 0, 0), (0.5, 0.4, 1))
    elements[0]["data"]["transformation"] = moved(7, 0, 0)
    stone = {"dtype": "compas_dem.material/Stone", "data": {"name": "Stone", "density": 2300}, "guid": "m"}
    children = [{"element": "e0", "children": [{"element": "e2"}]}, {"element": "e1"}]
    data = {
        "transformation": None,
        "elements": elements if as_list else {one["guid"]: one for one in elements},
        "materials": [stone] if as_list else {"m": stone},
        "tree": {"attributes": {}, "root": {"name": "root", "children": children}},
        "graph": {"node": {str(k): {"element": f"e{k}"} for k in range(3)}, "edge": {}},
    }
    return {"dtype": "compas_dem.models/BlockModel", "data": data, "guid": "model"}


def problem():
    return {"dtype": "compas_dem.problem/Problem", "data": {"name": "Problem", "model": block_model(as_list=True)}}


def saved(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("content", [before_1_0, version_1, version_2, assembly_of_parts, block_model, problem])
def test_assemblies_and_models_of_every_version(tmp_path, content):
    path = saved(tmp_path, content())
    layout = read_layout(path)
    assert layout.names == ("pier", "twin", "lintel") or layout.names == ("block 0", "block 1", "block 2")
    assert layout.roles == ("fixed", "fixed", "")
    assert layout.thickness == pytest.approx([0.4] * 3)
    assembly = read(path)
    assert assembly.areas == pytest.approx([0.5, 0.5, 1.0])
    assert assembly.centroids[2] == pytest.approx([1.0, 1.25])
    assert assembly.centroids[0] == pytest.approx([0.25, 0.5])


def test_the_material_of_a_model_gives_the_density(tmp_path):
    layout = read_layout(saved(tmp_path, block_model()))
    assert layout.materials == ("Stone", "Stone", "")
    assert layout.density[:2] == pytest.approx([2300.0] * 2)
    assert np.isnan(layout.density[2])


def test_lists_of_meshes_with_supports_of_their_own(tmp_path):
    wrapped = [{"dtype": "compas.datastructures/Mesh", "data": part} for part in parts()]
    assert read_layout(saved(tmp_path, wrapped)).names == ("pier", "twin", "lintel")
    nested = [[one] for one in wrapped]
    assert read(saved(tmp_path, nested)).n_blocks == 3
    layout = read_layout(saved(tmp_path, {"supports": wrapped[:2], "blocks": wrapped[2:]}))
    assert layout.roles == ("fixed", "fixed", "")
    assert layout.groups == ("supports", "supports", "")


def test_boxes_and_polyhedra(tmp_path):
    frame = {"point": [1.0, 0.2, 0.5], "xaxis": [0.0, 0.0, 2.0], "yaxis": [0.0, 1.0, 0.0]}
    box = {"dtype": "compas.geometry/Box", "data": {"xsize": 1.0, "ysize": 0.4, "zsize": 2.0, "frame": frame}}
    solid = {"vertices": corners((0, 0, 1), (2, 0.4, 0.5)), "faces": FACES}
    assembly = read(saved(tmp_path, [box, {"dtype": "compas.geometry/Polyhedron", "data": solid}]), view="xz")
    assert assembly.areas == pytest.approx([2.0, 1.0])
    assert assembly.centroids.tolist() == [[1.0, 0.5], [1.0, 1.25]]


def test_flat_meshes_and_polygons(tmp_path):
    square = {"0": {"x": 0.0}, "1": {"x": 1.0}, "2": {"x": 1.0, "y": 1.0}, "3": {"y": 1.0}, "4": {"x": 2.0, "y": 0.5}}
    pattern = {"vertex": square, "face": {"0": [0, 1, 2, 3], "1": [1, 4, 2]}}
    assert read(saved(tmp_path, {"dtype": "compas.datastructures/Mesh", "data": pattern})).areas.tolist() == [1.0, 0.5]
    polygons = [
        {"dtype": "compas.geometry/Polygon", "data": {"points": [[k, 0, 0], [k + 1, 0, 0], [k + 1, 1, 0], [k, 1, 0]]}}
        for k in range(2)
    ]
    assert read(saved(tmp_path, polygons)).areas.tolist() == [1.0, 1.0]


def test_a_ground_without_depth_is_left_out_with_a_note(tmp_path):
    content = before_1_0()
    content["blocks"]["3"] = mesh("ground", (-1, -1, 0), (5, 2, 0), text_keys=True, faces=FACES[:1])
    content["assembly"]["node"]["3"] = {"is_support": True}
    layout = read_layout(saved(tmp_path, content))
    assert layout.n_blocks == 3
    assert any("left out: 'ground' (a support), a single face without volume" in note for note in layout.notes)


def test_faces_given_twice_count_once(tmp_path):
    content = [
        {"dtype": "compas.datastructures/Mesh", "data": mesh("a", *box, faces=FACES + FACES)}
        for box in TRILITHON.values()
    ]
    assert read(saved(tmp_path, content)).n_blocks == 3


def test_what_is_three_dimensional_or_damaged_is_refused(tmp_path):
    behind = [*parts(), mesh("behind", (0, 0.4, 0), (0.5, 0.4, 1))]
    with pytest.raises(ValueError, match=r"is three-dimensional: .*seen along y, 'behind' lies behind 'pier'"):
        read(saved(tmp_path, behind), dimension=2)
    with pytest.raises(ValueError, match="body 'pier' is not closed: 4 edges belong to one face only"):
        read(saved(tmp_path, [mesh("pier", *TRILITHON["pier"], faces=FACES[1:])]))
    broken = parts()
    broken[0]["face"]["0"] = [0, 1, 99]
    with pytest.raises(ValueError, match="has a mesh of COMPAS that cannot be read, number 1"):
        read(saved(tmp_path, broken))
    for change, words in (
        ({"transformation": {"dtype": "t", "data": {"matrix": [1, 2, 3]}}}, "'lintel' has 3 numbers, not 4 × 4"),
        ({"density": "heavy"}, "has density 'heavy'; give a number"),
        ({"density": -5}, "has density -5"),
    ):
        model = block_model()
        if "density" in change:
            next(iter(model["data"]["materials"].values()))["data"] |= change
        else:
            next(iter(model["data"]["elements"].values()))["data"] |= {"name": "lintel", **change}
        with pytest.raises(ValueError, match=words):
            read(saved(tmp_path, model))
    brep = element(0, {})
    brep["data"]["geometry"] = {"dtype": "compas_occ.brep/OCCBrep", "data": {"faces": []}}
    model = block_model()
    model["data"]["elements"] = {"e0": brep}
    with pytest.raises(
        ValueError, match=r"a geometry that is no mesh \(compas_occ.brep/OCCBrep\); export the blocks as"
    ):
        read(saved(tmp_path, model))
    for content in ({"a": 1}, [1, 2], {"vertex": {}, "face": {}}, []):
        with pytest.raises(ValueError, match=r"is JSON but no layout; .* or meshes of COMPAS"):
            read(saved(tmp_path, content))


def test_objects_without_end_are_not_followed(tmp_path):
    content: object = parts()
    for _ in range(300):
        content = [content]
    with pytest.raises(ValueError, match="is JSON but no layout"):
        read(saved(tmp_path, content))


def test_info_and_convert(tmp_path, capsys):
    path = saved(tmp_path, version_2())
    assert main(["info", str(path)]) == 0
    assert "'fixed' 2" in capsys.readouterr().out
    assert main(["convert", str(path), str(tmp_path / "b.json")]) == 0
    again = read_layout(tmp_path / "b.json")
    assert again.roles == ("fixed", "fixed", "")
    assert again.n_blocks == 3


def test_elements_and_nodes_without_a_body_are_counted(tmp_path):
    model = block_model()
    model["data"]["elements"]["e1"]["data"]["geometry"] = None
    assembly = version_2()
    del assembly["data"]["graph"]["data"]["node"]["1"]["block"]
    for content, what in ((model, "elements without geometry"), (assembly, "nodes without a block")):
        layout = read_layout(saved(tmp_path, content))
        assert layout.n_blocks == 2
        assert f"skipped: 1 {what}" in layout.notes
