"""GeoJSON, GeoPackages and shapefiles: blocks, names, groups and units; what is in degrees is refused."""

import json
import sqlite3
import struct
import sys
from contextlib import closing

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import drawn

import blockvis

SQUARES = [[[x, y], [x + 0.4, y], [x + 0.4, y + 0.2], [x, y + 0.2], [x, y]] for y in (0, 0.2) for x in (0, 0.4)]
UTM = 'PROJCS["WGS 84 / UTM 32N",GEOGCS["WGS 84",UNIT["degree",0.01745]],UNIT["{}",{}],AUTHORITY["EPSG","32632"]]'
DEGREES = 'GEOGCS["WGS 84",DATUM["WGS_1984"],UNIT["degree",0.0174532925199433]]'


def geojson(path, features, **more):
    whole = [one if "geometry" in one else {"geometry": one} for one in features]
    text = json.dumps({"type": "FeatureCollection", "features": [{"type": "Feature", **one} for one in whole], **more})
    path.write_text(text, encoding="utf-8")
    return path


def polygon(*rings, **properties):
    return {"geometry": {"type": "Polygon", "coordinates": list(rings)}, "properties": properties}


def geopackage(path, layers):
    """Write layers by name: (geometry, stone) each; ``system`` is the first word of a layer's number."""
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id)")
        base.execute("CREATE TABLE gpkg_spatial_ref_sys (srs_id, srs_name, definition)")
        base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES (-1, 'Undefined Cartesian', 'undefined')")
        base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES (2, 'in feet', ?)", (UTM.format("foot", 0.3048),))
        base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES (4326, 'WGS 84', ?)", (DEGREES,))
        for name, (system, rows) in layers.items():
            quoted = name.replace('"', '""')
            base.execute(f'CREATE TABLE "{quoted}" (fid INTEGER PRIMARY KEY, geom BLOB, stone TEXT)')
            base.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?)", (name, system))
            for k, (geometry, stone) in enumerate(rows):
                envelope = struct.pack("<4d", *np.array(geometry.bounds)[[0, 2, 1, 3]]) if k % 2 else b""
                blob = b"GP\0" + struct.pack("<Bi", 3 if k % 2 else 1, system) + envelope + shapely.to_wkb(geometry)
                base.execute(f'INSERT INTO "{quoted}" (geom, stone) VALUES (?, ?)', (blob, stone))
        base.commit()
    return path


def refusal(path, **options):
    with pytest.raises(ValueError) as caught:
        blockvis.read_layout(path, **options)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_words_for_roles(tmp_path):
    words = ("support", " Moving ", "wall", "")
    path = geojson(tmp_path / "a.geojson", [polygon(one, role=role) for one, role in zip(SQUARES, words, strict=True)])
    layout = blockvis.read_layout(path)
    assert layout.roles == ("fixed", "moving", "", "")
    assert any("roles were left out ('wall'): roles are free, fixed, moving" in note for note in layout.notes)


def test_a_thickness_that_is_no_number_is_refused_by_its_block(tmp_path):
    path = geojson(tmp_path / "a.geojson", [polygon(SQUARES[0], thickness="0.3"), polygon(SQUARES[1], thickness="0,4")])
    assert "block 'block 1' has thickness '0,4'; give a number" in refusal(path)
    assert "has thickness True" in refusal(geojson(path, [polygon(SQUARES[0], thickness=True)]))


def test_properties_give_names_groups_and_roles(tmp_path):
    features = [
        polygon(SQUARES[0], kind="ground", Name="foot", role="fixed"),
        polygon(SQUARES[1], kind="brick", Name="B1", density=1800),
        polygon(SQUARES[2], kind="brick", Name=None),
        {"geometry": None},
        {"geometry": {"type": "Point", "coordinates": [0, 0]}},
    ]
    layout = blockvis.read_layout(geojson(tmp_path / "wall.geojson", features))
    assert layout.names == ("foot", "B1", "block 2")
    assert layout.groups == layout.materials == ("ground", "brick", "brick")
    assert layout.roles == ("fixed", "", "")
    assert layout.density[1] == 1800
    np.testing.assert_allclose(layout.sizes**2, 0.08)
    assert layout.points[:, 1].min() == 0.0, "y points up"
    assert "skipped: 1 features without geometry, 1 Point" in layout.notes


def test_numbers_that_tell_features_apart_name_them(tmp_path):
    path = geojson(tmp_path / "wall.json", [polygon(ring, id=0, fid=k + 5) for k, ring in enumerate(SQUARES)])
    assert blockvis.read_layout(path).names == ("fid 5", "fid 6", "fid 7", "fid 8")


@settings(max_examples=20)
@given(n=st.integers(1, 5), shift=st.tuples(st.floats(0, 6e5), st.floats(0, 6e6)), scale=st.floats(0.1, 5))
def test_a_layout_comes_back_from_geojson(tmp_path_factory, n, shift, scale):
    path = tmp_path_factory.mktemp("wall") / "wall.geojson"
    rings = tuple(np.array(SQUARES[0][:-1]) * scale + shift + [0.4 * k * scale, 0] for k in range(n))
    names = tuple(f"stone ä{k}" for k in range(n))
    drawing = drawn(path.with_name("wall.json"), rings, names, role=("fixed",) * n, group=("lowest",) * n)
    layout = blockvis.read_layout(drawing)
    blockvis.write_layout(layout, path)
    back = blockvis.read_layout(path)
    assert (back.names, back.roles, back.groups) == (names, layout.roles, layout.groups)
    np.testing.assert_array_equal(back.points, layout.points)


def test_several_polygons_holes_and_lines_of_features(tmp_path):
    far = np.add(SQUARES[0], [3, 0]).tolist()
    hole = (np.array(SQUARES[0]) * 0.5 + [5.1, 0.05]).tolist()
    outer = np.add(SQUARES[0], [5, 0]).tolist()
    cross = [[[3, 0.1], [3.4, 0.1]]]
    features = [
        {"type": "MultiPolygon", "coordinates": [[SQUARES[0]], [far]]},
        {"type": "Polygon", "coordinates": [outer, hole]},
        {"type": "MultiLineString", "coordinates": cross},
        {"type": "LineString", "coordinates": SQUARES[1]},
    ]
    layout = blockvis.read_layout(geojson(tmp_path / "wall.geojson", features))
    assert sorted(np.round(layout.sizes**2, 6)) == [0.04, 0.04, 0.08, 0.08], "the line cuts a block in two"
    assert [(item.kind, len(item.holes)) for item in layout.left_out] == [("hole", 1)]


def test_lines_alone_enclose_blocks(tmp_path):
    grid = [[[x, 0], [x, 0.4]] for x in (0, 0.4, 0.8)] + [[[0, y], [0.8, y]] for y in (0, 0.2, 0.4)]
    path = geojson(tmp_path / "net.geojson", [{"type": "LineString", "coordinates": line} for line in grid])
    np.testing.assert_allclose(blockvis.read_layout(path).sizes ** 2, [0.08] * 4)


def test_a_facade_that_stands_upright_is_turned(tmp_path):
    upright = [[[100 + x, 7, z] for x, z in ring] for ring in SQUARES]
    layout = blockvis.read_layout(geojson(tmp_path / "facade.geojson", [polygon(ring) for ring in upright]))
    assert np.ptp(layout.points, axis=0) == pytest.approx([0.8, 0.4])
    assert any("upright" in note for note in layout.notes)
    slanting = [[[0.8 * x, 7 + 0.6 * x, z] for x, z in ring] for ring in SQUARES]
    seen = blockvis.read_layout(geojson(tmp_path / "facade.geojson", [polygon(ring) for ring in slanting]), view="xz")
    assert np.ptp(seen.points, axis=0) == pytest.approx([0.8, 0.4])
    assert any("stands upright at 36.9° to x" in note for note in seen.notes)
    # Nor does a plan that is not wanted decide it.
    stones = [polygon(ring, group="facade") for ring in slanting]
    both = geojson(tmp_path / "both.geojson", [*stones, polygon([[0, 0], [9, 0], [9, 9], [0, 0]], group="plan")])
    for chosen in ({"only": "facade"}, {"ignore": "plan"}):
        again = blockvis.read_layout(both, **chosen)
        assert np.ptp(np.concatenate(again.outlines), axis=0) == pytest.approx([0.8, 0.4])


def test_a_thickness_in_another_unit_than_its_drawing_is_doubted(tmp_path):
    """It is in the unit of the drawing: of stones in mm, 500, and 0.5 is half a millimetre, if of one row alone."""
    rings = (np.array(SQUARES) * 1000.0).tolist()
    for said, doubtful in (([500] * 4, 0), ([0.5] * 4, 4), ([500, 500, 0.5, 500], 1), ([500, 0.5, 500, 0.5], 2)):
        stones = [polygon(ring, name=f"stone {k}", thickness=said[k]) for k, ring in enumerate(rings)]
        # Ground of 30 by 60 m is no thinner for it than the stones.
        ground = polygon([[-3e4, -3e4], [3e4, -3e4], [3e4, 0], [-3e4, 0]], name="ground", thickness=500)
        layout = blockvis.read_layout(geojson(tmp_path / "mm.geojson", [*stones, ground]), unit="mm")
        assert layout.thickness.tolist() == pytest.approx([each / 1000.0 for each in said] + [0.5])
        notes = " ".join(layout.notes)
        assert ("thickness in doubt" in notes) == bool(doubtful)
        if doubtful:
            first = f"thickness in doubt: 0.0005 m of block 'stone {said.index(0.5)}', 0.283 m across"
            assert f"{first} ({doubtful} of 5 thicknesses are as doubtful); the file has it in mm: correct it" in notes


def test_degrees_are_refused_with_the_command_that_makes_them_metres(tmp_path):
    rings = [(np.array(ring) * 1e-5 + [12.49, 41.89]).tolist() for ring in SQUARES]
    path = geojson(tmp_path / "rome.geojson", [polygon(ring) for ring in rings])
    said = refusal(path)
    assert "is in degrees: its median block is 2.8e-06 across" in said
    assert (
        "ogr2ogr -s_srs EPSG:4326 -t_srs EPSG:32633 rome_m.gpkg rome.geojson; if they are no degrees, give their unit"
        in said
    )
    assert blockvis.read_layout(path, unit="km").n_blocks == 4
    stated = {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}
    geojson(path, [polygon((-np.array(ring)).tolist()) for ring in rings], **stated)
    assert "CRS84" in (said := refusal(path, unit="m"))
    assert "EPSG:32728" in said, "south of the equator"


def test_a_park_in_degrees_is_no_block_but_what_says_that_it_has_no_system_is(tmp_path):
    far = [polygon([[x - 106.0, y + 40.0] for x, y in SQUARES[0]])]
    path = geojson(tmp_path / "park.geojson", far)
    assert "is in degrees: its median block is" in refusal(path)
    assert blockvis.read_layout(path, unit="m").n_blocks == 1
    assert blockvis.read_layout(geojson(path, far, crs=None)).n_blocks == 1


def test_metres_that_a_program_calls_degrees_are_read_with_a_note(tmp_path):
    stated = {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}
    layout = blockvis.read_layout(geojson(tmp_path / "w.geojson", [polygon(ring) for ring in SQUARES], **stated))
    assert layout.n_blocks == 4
    assert any(note.startswith("the file says degrees (urn") for note in layout.notes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"type": "FeatureCollection"}, 'without a list "features"'),
        ({"type": "FeatureCollection", "features": []}, "has no polygon (found: nothing)"),
        ({"type": "FeatureCollection", "features": [3]}, "feature 0 has a geometry that cannot be read"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [1, 0]]]}, "feature 0 has a geometry that cannot be read"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, float("nan")]]]}, "must be finite"),
        ({"type": "LineString", "coordinates": [[0, 0], [1, 0]]}, "has no polygon (found: 1 line closes nothing"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [10**400, 0], [1, 1]]]}, "feature 0 has a geometry that cannot"),
        ({"type": "FeatureCollection", "crs": {"properties": None}, "features": []}, "has no polygon (found: nothing)"),
        ({"type": "Topology"}, "features of GeoJSON, or"),
    ],
)
def test_geojson_that_draws_no_block_is_refused(tmp_path, content, words):
    path = tmp_path / "bad.geojson"
    path.write_text(json.dumps(content), encoding="utf-8")
    assert words in refusal(path)


def test_layers_of_a_geopackage_are_groups(tmp_path):
    shapes = [shapely.Polygon(ring) for ring in SQUARES]
    both = shapely.MultiPolygon(shapes[2:])
    layers = {"fixed": (2, [(shapes[0], "a"), (shapes[1], "b")]), 'odd"name': (2, [(both, None)])}
    layout = blockvis.read_layout(geopackage(tmp_path / "wall #1.gpkg", layers))
    assert layout.groups == ("fixed", "fixed", 'odd"name', 'odd"name')
    assert layout.names == ("a", "b", "block 2 1", "block 2 2")
    assert layout.unit == "ft"
    np.testing.assert_allclose(layout.sizes**2, 0.08 * 0.3048**2)


def test_layers_in_several_systems_are_refused_unless_one_is_chosen(tmp_path):
    stone = shapely.Polygon(SQUARES[0])
    path = geopackage(tmp_path / "two.gpkg", {"wall": (-1, [(stone, "a")]), "site": (4326, [(stone, "b")])})
    assert "layers in several coordinate systems: 'wall' in none, 'site' in WGS 84; leave one out" in refusal(path)
    for asked in ({"only": "wall"}, {"ignore": "s*"}):
        layout = blockvis.read_layout(path, **asked)
        assert layout.groups == ("wall",)
        assert "left out: 1 outline, as asked for on layer 'site'" in layout.notes
        assert not [note for note in layout.notes if "matches no" in note]


def test_damaged_geopackages_are_refused(tmp_path):
    path = tmp_path / "bad.gpkg"
    path.write_bytes(b"SQLite format 3\0" + bytes(100))
    assert "is no readable GeoPackage" in refusal(path)
    geopackage(path := tmp_path / "cut.gpkg", {"wall": (-1, [(shapely.Polygon(SQUARES[0]), "a")])})
    arc = struct.pack("<BII6d", 1, 8, 3, 0.0, 0.0, 1.0, 1.0, 2.0, 0.0)
    nan = struct.pack("<BIII6d", 1, 3, 1, 3, 0.0, 0.0, 1.0, np.nan, 0.0, 0.0)
    damaged = {b"GP\0\1" + bytes(4) + nan: "must be finite numbers"}
    damaged |= {b"GP\0\1" + bytes(4) + arc: "straighten it: ogr2ogr -nlt CONVERT_TO_LINEAR cut_straight.gpkg cut.gpkg"}
    damaged |= {b"GP\0\1": "no header", b"GP\0\x21" + bytes(9): "extended", b"GP\0\1" + bytes(9): "cannot be read"}
    for blob, words in damaged.items():
        with closing(sqlite3.connect(path)) as base:
            base.execute("UPDATE wall SET geom = ?", (blob,))
            base.commit()
        assert words in refusal(path)
    with closing(sqlite3.connect(path)) as base:
        base.execute("UPDATE gpkg_geometry_columns SET column_name = 'shape'")
        base.commit()
    assert "cut.gpkg' is no readable GeoPackage" in refusal(path)


def write_shapefile(path, rings, projection=None, kind=5, **attributes):
    shapefile = pytest.importorskip("shapefile")
    with shapefile.Writer(str(path), shapeType=kind) as writer:
        for key in attributes:
            writer.field(key, "C")
        writer.field("number", "N")
        for k, ring in enumerate(rings):
            writer.poly([ring[::-1]])
            writer.record(*(values[k] for values in attributes.values()), k)
    if projection:
        path.with_suffix(".prj").write_text(projection, encoding="utf-8")
    return path


def test_a_shapefile_is_read_with_its_table_and_unit(tmp_path):
    path = tmp_path / "wall[1].shp"
    write_shapefile(
        path, SQUARES, UTM.format("Foot_US", 0.304800609601219), label=["a", "b", "c", "d"], layer=["x"] * 4
    )
    layout = blockvis.read_layout(path)
    assert (layout.names, layout.groups, layout.unit) == (("a", "b", "c", "d"), ("x",) * 4, "ft")
    np.testing.assert_allclose(layout.sizes**2, 0.08 * 0.3048**2)
    path.with_suffix(".dbf").unlink()
    path.with_suffix(".shx").unlink()
    assert blockvis.read_layout(path).names == ("block 0", "block 1", "block 2", "block 3")


def test_shapefiles_in_degrees_and_damaged_ones_are_refused(tmp_path):
    rings = [(np.array(ring) * 1e-5 + 41.5).tolist() for ring in SQUARES]
    path = write_shapefile(tmp_path / "far.shp", rings, DEGREES)
    assert "is in degrees (WGS 84)" in (said := refusal(path))
    assert "ogr2ogr -t_srs EPSG:32637 far_m.gpkg far.shp" in said
    path.write_bytes(path.read_bytes()[:150])
    assert "cannot be read as a shapefile" in refusal(path)


def test_a_shapefile_without_its_package_names_the_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "shapefile", None)
    (tmp_path / "wall.shp").write_bytes(bytes(100))
    with pytest.raises(ImportError, match=r"need pyshp, which .*pip install 'blockvis\[geo\]'$"):
        blockvis.read_layout(tmp_path / "wall.shp")


@pytest.mark.parametrize(
    "heights",
    [
        ',VERTCS["NAVD_1988",VDATUM["NAVD_1988"],PARAMETER["Direction",1.0],UNIT["Meter",1.0]]',
        ',VERT_CS["height",VERT_DATUM["d",2005],UNIT["metre",1]]]',
        ',VERTCRS["height",VDATUM["d"],CS[vertical,1],AXIS["up",up],LENGTHUNIT["metre",1]]]',
    ],
)
def test_the_unit_of_heights_is_not_that_of_the_plan(tmp_path, heights):
    system = (
        'COMPD_CS["plan and heights",' * heights.endswith("]]]") + UTM.format("Foot_US", 0.304800609601219) + heights
    )
    path = write_shapefile(tmp_path / "wall.shp", SQUARES, system)
    assert blockvis.read_layout(path).unit == "ft"


def test_a_unit_that_has_no_name_here_is_read_by_its_length(tmp_path):
    path = write_shapefile(tmp_path / "wall.shp", SQUARES, UTM.format("Link", 0.201168))
    np.testing.assert_allclose(blockvis.read_layout(path).sizes ** 2, 0.08 * 0.201168**2)


@pytest.mark.parametrize(
    ("north", "scale", "told"), [(5621521.0, 0.5**0.5, "1.414 times as long at 45° N"), (3.0, 1.0, "")]
)
def test_metres_of_maps_of_the_web_are_as_long_as_they_are_there(tmp_path, north, scale, told):
    rings = [np.add(ring, [1378000.0, north]).tolist() for ring in SQUARES]
    system = {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}}
    path = geojson(tmp_path / "plan.geojson", [polygon(ring) for ring in rings], **system)
    layout = blockvis.read_layout(path)
    np.testing.assert_allclose(layout.sizes**2, 0.08 * scale**2, rtol=1e-5)
    assert [note for note in layout.notes if "3857" in note and told in note] or not told
    assert len([note for note in layout.notes if "3857" in note]) == bool(told)
    np.testing.assert_allclose(blockvis.read_layout(path, unit="m").sizes ** 2, 0.08, rtol=1e-5)
    words = 'PROJCS["WGS 84 / Pseudo-Mercator",PROJECTION["Mercator_1SP"],UNIT["metre",1],AUTHORITY["EPSG","3857"]]'
    shapes = write_shapefile(tmp_path / "plan.shp", rings, words)
    np.testing.assert_allclose(blockvis.read_layout(shapes).sizes ** 2, 0.08 * scale**2, rtol=1e-5)


def on_the_web(path, *features, system="urn:ogc:def:crs:EPSG::3857"):
    stones = [polygon(np.add(ring, [1378000.0, 5621521.0]).tolist(), layer="stones") for ring in SQUARES]
    return geojson(path, [*stones, *features], crs={"type": "name", "properties": {"name": system}})


@pytest.mark.parametrize(
    ("system", "stretched"),
    [
        ("http://www.opengis.net/def/crs/EPSG/0/3857", True),
        ("urn:ogc:def:crs:EPSG:9.9.1:3857", True),
        ("EPSG:102100", True),
        ("urn:ogc:def:crs:ESRI::102113", True),
        ("EPSG:900913", True),
        ("EPSG:3785", True),
        ("urn:ogc:def:crs:EPSG::3395", True),
        ("urn:ogc:def:crs:EPSG::32632", False),
        ("urn:ogc:def:crs:EPSG:3857:25832", False),
        ("EPSG:3857 ", True),
        ("WGS 84 / Pseudo-Mercator", True),
        ("WGS_1984_Web_Mercator_Auxiliary_Sphere", True),
        ("WGS 84 / World Mercator", True),
        ("WGS 84 / UTM zone 32N", False),
    ],
)
def test_a_mercator_of_the_world_is_known_by_its_number_or_its_words_in_geojson(tmp_path, system, stretched):
    sizes = blockvis.read_layout(on_the_web(tmp_path / "plan.geojson", system=system)).sizes
    np.testing.assert_allclose(sizes**2, 0.04 if stretched else 0.08, rtol=1e-5)


def test_an_upright_drawing_in_a_mercator_is_refused(tmp_path):
    """It stretches lengths on the map, but no heights."""
    rings = [[[1378000.0 + x, 5621521.0, z] for x, z in ring] for ring in SQUARES]
    system = {"type": "name", "properties": {"name": "EPSG:3857"}}
    path = geojson(tmp_path / "elevation.geojson", [polygon(ring, layer="stones") for ring in rings], crs=system)
    with pytest.raises(ValueError, match=r"elevation\.geojson.*stand upright in a Mercator.*reproject it"):
        blockvis.read_layout(path)


@pytest.mark.parametrize(
    ("words", "stretch"),
    [
        ('PROJECTION["Mercator_Auxiliary_Sphere"],PARAMETER["Standard_Parallel_1",0.0],UNIT["Meter",1.0]', 2**0.5),
        ('PROJECTION["Mercator_1SP"],PARAMETER["scale_factor",1],UNIT["metre",1,AUTHORITY["EPSG","9001"]]', 2**0.5),
        (
            'PROJECTION["Mercator_2SP"],PARAMETER["standard_parallel_1",0],UNIT["Foot_US",0.3048006]',
            1.0363021 / 0.3048006,
        ),
        ('PROJECTION["Mercator"],PARAMETER["Standard_Parallel_1",44.0],UNIT["Meter",1.0]', 1.3303154),
        (
            'CONVERSION["M",METHOD["Mercator (variant B)",ID["EPSG",9805]],PARAMETER["Latitude of 1st standard '
            'parallel",-44,ANGLEUNIT["degree",0.01745]],PARAMETER["False northing",1690011,LENGTHUNIT["metre",1]]],'
            'LENGTHUNIT["metre",1]',
            1.0,
        ),
        ('METHOD["Popular Visualisation Pseudo Mercator",ID["EPSG",1024]],LENGTHUNIT["metre",1]', 2**0.5),
        ('PROJECTION["Mercator"],PARAMETER["Scale_Factor",0.0],UNIT["Meter",1.0]', 1.0),
        ('PROJECTION["Transverse_Mercator"],PARAMETER["Scale_Factor",0.9996],UNIT["Meter",1.0]', 1.0),
        ('PROJECTION["Hotine_Oblique_Mercator_Azimuth_Center"],PARAMETER["Scale_Factor",1],UNIT["Meter",1.0]', 1.0),
    ],
)
def test_a_mercator_is_known_by_its_projection_and_is_as_long_as_it_says(tmp_path, words, stretch):
    """Names did not tell: "unnamed" or "Sphere_Mercator" were 41 % too long at 45 degrees."""
    rings = [np.add(ring, [1378000.0, 5621521.0]) for ring in SQUARES]
    path = write_shapefile(tmp_path / "plan.shp", [ring.tolist() for ring in rings], f'PROJCS["unnamed",{words}]')
    np.testing.assert_allclose(blockvis.read_layout(path).sizes ** 2, 0.08 / stretch**2, rtol=1e-5)


@pytest.mark.parametrize("options", [{"ignore": ("title",)}, {"only": ("stones",)}, {}])
def test_a_title_at_the_equator_does_not_move_the_plan_there(tmp_path, options):
    """The latitude was the middle of all that is in the file, and lengths were 29 % too large."""
    title = polygon(SQUARES[0], layer="title")
    layout = blockvis.read_layout(on_the_web(tmp_path / "plan.geojson", title, title, title), **options)
    np.testing.assert_allclose(layout.sizes[:4] ** 2, 0.04, rtol=1e-5)
