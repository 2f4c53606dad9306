"""Outlines of geographic information systems: GeoJSON, GeoPackages and shapefiles; y points up, attributes are kept."""

from __future__ import annotations

import json
import logging
import math
import re
import sqlite3
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import ShapelyError
from shapely.geometry import shape

from blockvis.layout.block_table import rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut, matches, passed_over
from blockvis.layout.notes import CHANGED, UNIT, Note
from blockvis.layout.outlines import ring_area
from blockvis.layout.units import DOUBTED, metres_per, unit_of
from blockvis.system.extras import require
from solver import mechanics

from .bodies import ROLE_WORDS
from .drawing import Drawing, Line, Outline, joined_ends
from .loose_lines import refuse_open, with_faces
from .reading import Reading, parsing

#: Attributes that name a block and its group, the first that a file has; in small letters.
NAMES = ("name", "label", "title", "stone", "block", "brick", "id", "fid", "objectid")
GROUPS = ("group", "layer", "kind", "class", "type", "category")

#: Types of GeoJSON objects that hold outlines.
GEOJSON = (
    "FeatureCollection", "Feature", "GeometryCollection", "Polygon", "MultiPolygon", "LineString", "MultiLineString",
)  # fmt: skip

#: What a file without a coordinate system draws so many of its widths away from 0 is a park or a country in degrees.
FAR = 50.0

#: Numbers, of EPSG and of Esri, of Mercators that are true to scale at the equator.
MERCATORS = r"\b(3857|3785|3395|3832|900913|102100|102113|53004|54004)\W*$"
OF_THE_WORLD = "(Pseudo|Web|World|Global|Google|Visualisation CRS /)"

#: Radius of the earth on the maps of the web [m], and by which part lengths are off that take it for a sphere.
RADIUS, OFF = 6378137.0, 0.007

#: What is counted of features that draw nothing.
NO_GEOMETRY = "features without geometry"

#: Bytes of the envelope in the header of a geometry of a GeoPackage, by its kind.
ENVELOPES = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}


@dataclass(frozen=True)
class System:
    """A coordinate system: its unit of length, "" where nothing says it, and its name if it is in degrees.

    ``mercator`` is the scale of a Mercator at the equator and its northing there; ``is_none`` whether the file says
    that it has no system.
    """

    unit: str = ""
    degrees: str = ""
    mercator: tuple[float, float] | None = None
    is_none: bool = False

    @classmethod
    def of(cls, text: str) -> System:
        """Read a system in words."""
        # Heights have a system of their own behind that of the plan, and often another unit.
        plan = re.split(r"\bVERT\w*\s*\[", text)[0]
        head = re.search(r'\b(PROJCS|PROJCRS|GEOGCS|GEOGCRS|GEODCRS|LOCAL_CS|ENGCRS)\s*\[\s*"([^"]*)"', plan)
        if head is None:
            return cls(mercator=_mercator(text))
        if head[1].startswith("GEO"):
            return cls(degrees=head[2], mercator=_mercator(text))
        found = re.findall(r'\b(?:LENGTH)?UNIT\s*\[\s*"[^"]*"\s*,\s*([-+.\deE]+)', plan)
        try:
            metres = float(found[-1]) if found else 0.0
        except ValueError:
            metres = 0.0
        unit = unit_of(metres, 1e-5) or (f"{metres:.9g} m" if 0.0 < metres < math.inf else "")
        return cls(unit, mercator=_mercator(text))


@dataclass(frozen=True)
class Feature:
    """A geometry of shapely with its attributes, and the layer on which it lies."""

    geometry: Any
    attributes: Mapping[str, Any]
    layer: str = ""


def read_content(content: Any, path: Path, reading: Reading) -> Layout | None:
    """Read parsed GeoJSON, which states no unit; None if it is another kind of JSON."""
    if not isinstance(content, dict) or content.get("type") not in GEOJSON:
        return None
    features = [_feature(one, k) for k, one in enumerate(_geojson_features(content))]
    crs = content.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    says = name if re.search(r"CRS84|4326$", name) else ""
    known = [one for one in features if one is not None]
    system = System(degrees=says, mercator=_mercator(name), is_none="crs" in content and crs is None)
    return layout_of_features(known, path, reading, system, {NO_GEOMETRY: len(features) - len(known)})


def _geojson_features(content: Mapping[str, Any]) -> list[Any]:
    if content["type"] != "FeatureCollection":
        return [content]
    features = content.get("features")
    if not isinstance(features, list):
        raise ValueError('it is GeoJSON without a list "features"; export it again')
    return features


def _feature(found: Any, number: int) -> Feature | None:
    """Make a feature of a member of GeoJSON; None of one without geometry."""
    whole = isinstance(found, dict) and found.get("type") == "Feature"
    geometry = found.get("geometry") if whole else found
    if geometry is None:
        return None
    properties = found.get("properties") if whole else None
    attributes = dict(properties) if isinstance(properties, dict) else {}
    if whole and isinstance(found.get("id"), str | int):
        attributes.setdefault("id", found["id"])
    try:
        with np.errstate(invalid="ignore"):
            return Feature(shape(geometry), attributes)
    except (ShapelyError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:120]
        raise ValueError(f"feature {number} has a geometry that cannot be read ({reason}); repair it") from None


def read(path: Path, reading: Reading) -> Layout:
    """Read a GeoPackage, .gpkg, or a shapefile, .shp, with what lies beside it."""
    return _read_shapefile(path, reading) if path.suffix.lower() == ".shp" else _read_geopackage(path, reading)


def _read_shapefile(path: Path, reading: Reading) -> Layout:
    require("geo", f"shapefiles ('{path}'; GeoJSON and GeoPackage are read without)")
    import shapefile

    beside = {entry.suffix.lower(): entry for entry in path.parent.glob(f"{escape(path.stem)}.*")}
    table, projection = beside.get(".dbf"), beside.get(".prj")
    features, skipped = [], Counter[str]()
    # What pyshp would print of rings that turn the wrong way is no fault of a drawing.
    logging.getLogger("shapefile").setLevel(logging.CRITICAL + 1)
    with (
        parsing("a shapefile"),
        path.open("rb") as shapes,
        (table or path).open("rb") as rows,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        files = {"shp": shapes, **({"dbf": rows} if table else {})}
        reader = shapefile.Reader(**files, encodingErrors="replace")
        records = [record.as_dict() for record in reader.iterRecords()] if table else []
        for k, drawn in enumerate(reader.iterShapes()):
            if drawn.shapeTypeName in ("NULL", "MULTIPATCH"):
                skipped[NO_GEOMETRY if drawn.shapeTypeName == "NULL" else "MULTIPATCH"] += 1
                continue
            row = records[k] if k < len(records) else {}
            features.append(Feature(shape(drawn.__geo_interface__), row))
    text = projection.read_text(encoding="utf-8", errors="replace") if projection else ""
    return layout_of_features(features, path, reading, System.of(text), skipped)


def _read_geopackage(path: Path, reading: Reading) -> Layout:
    try:
        # Read only, as it is: a journal beside it is not played back.
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            layers = _layers(base, path)
    except (sqlite3.Error, IndexError) as error:
        # Python's error where a table lacks the column that the contents name.
        raise ValueError(f"it is no readable GeoPackage ({error}); export it again") from None
    chosen = [one for one in layers if matches([one.name], reading.only)] or layers
    wanted = [one for one in chosen if not matches([one.name], reading.ignore)]
    systems = {layer.system: layer for layer in reversed(wanted)}
    if len(systems) > 1:
        listed = ", ".join(f"'{one.name}' in {one.system or 'none'}" for one in reversed(systems.values()))
        raise ValueError(
            f"it has layers in several coordinate systems: {listed}; leave one out (ignore), or export one"
        )
    system = System.of("".join(layer.description for layer in systems.values()))
    # What is left out as asked is counted with the rest, but not what lies in another system.
    features = [feature for layer in layers if layer.system in systems for feature in layer.features]
    skipped = {NO_GEOMETRY: sum(layer.empty for layer in layers if layer.system in systems)}
    found = layout_of_features(features, path, reading, system, skipped)
    other = [LeftOut("asked", np.zeros((0, 2)), "", one.name) for one in layers if one.system not in systems]
    return replace(found, left_out=(*found.left_out, *other))


@dataclass(frozen=True)
class _Layer:
    """A table of a GeoPackage: its features, the number of those without geometry, and its coordinate system.

    Name and description of the system are "" for none.
    """

    name: str
    features: list[Feature]
    empty: int
    system: str
    description: str


def _layers(base: sqlite3.Connection, path: Path) -> list[_Layer]:
    base.execute("PRAGMA trusted_schema = OFF")
    base.row_factory = sqlite3.Row
    found = []
    for table in base.execute("SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns").fetchall():
        name, column = str(table["table_name"]), str(table["column_name"])
        quoted = name.replace('"', '""')
        rows = base.execute(f'SELECT * FROM "{quoted}"').fetchall()
        features = [_row_feature(dict(row), column, name, path) for row in rows if row[column] is not None]
        query = "SELECT srs_name, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?"
        system, text = base.execute(query, (table["srs_id"],)).fetchone() or (table["srs_id"], "")
        system = "" if str(system).lower().startswith("undefined") else str(system)
        found.append(_Layer(name, features, len(rows) - len(features), system, str(text)))
    return found


def _row_feature(row: dict[str, Any], column: str, layer: str, path: Path) -> Feature:
    blob = row.pop(column)
    called = f"geometry {row.get('fid', '?')} of layer '{layer}'"
    if not isinstance(blob, bytes) or blob[:2] != b"GP" or len(blob) < 8:
        raise ValueError(f"{called} has no header of a GeoPackage; export it again")
    start = ENVELOPES.get((blob[3] >> 1) & 7)
    if start is None or blob[3] & 32:
        raise ValueError(f"{called} is of an extended kind, which is not read; export it again")
    try:
        # What is not finite is refused by its place.
        with np.errstate(invalid="ignore"):
            return Feature(shapely.from_wkb(blob[8 + start :]), row, layer)
    except NotImplementedError:
        remedy = f"ogr2ogr -nlt CONVERT_TO_LINEAR {path.stem}_straight.gpkg {path.name}"
        raise ValueError(f"{called} has arcs or is in space, which is not read; straighten it: {remedy}") from None
    except (ShapelyError, ValueError, TypeError) as error:
        raise ValueError(f"{called} cannot be read ({' '.join(str(error).split())}); export it again") from None


def _mercator(text: str) -> tuple[float, float] | None:
    """Find the scale of a Mercator at the equator and its northing there, by words or number; None if it is none."""
    # Transverse and oblique ones are true along a line through the drawing.
    if re.search(r'\b(PROJECTION|METHOD)\s*\[\s*"(Mercator|Popular)', text, re.IGNORECASE) is None:
        # GeoJSON has a name or a number alone.
        return (1.0, 0.0) if re.search(rf"{OF_THE_WORLD}[- _]+Mercator|{MERCATORS}", text, re.IGNORECASE) else None
    found = re.findall(r'\bPARAMETER\s*\[\s*"([^"]*)"\s*,\s*([-+]?\d+\.?\d*(?:[eE][-+]?\d+)?)', text)
    given = {name.lower().replace("_", " "): float(value) for name, value in found}
    parallel = given.get("standard parallel 1", given.get("latitude of 1st standard parallel", 0.0))
    scale = given.get("scale factor", given.get("scale factor at natural origin", 1.0))
    return scale * math.cos(math.radians(parallel)), given.get("false northing", 0.0)


def _true_unit(found: Drawing, reading: Reading, system: System) -> tuple[str, list[Note]]:
    """Find how long the unit of a Mercator is where a drawing lies, with a note; the unit itself where it is as long.

    What is left out as asked, as a scale bar, does not count, and what lies far from the rest does not matter.
    """
    if system.mercator is None or reading.unit is not None:
        return system.unit, []
    (scale, start), metres = system.mercator, metres_per(system.unit or "m")
    wanted = found.wants(reading)
    # Before it is turned into its plane: (n, 3).
    middles = [float(one.points[:, 1].mean()) for one in found.strokes if wanted(one)]
    north = (float(np.median(middles)) - start) * metres / (scale * RADIUS) if middles and scale > 0.0 else math.inf
    # Beyond is no map.
    stretch = scale * math.cosh(north) if abs(north) <= math.pi else 1.0
    if abs(stretch - 1.0) < 1e-3:
        return system.unit or "m", []
    latitude = math.degrees(math.atan(math.sinh(north)))
    said = (
        f"unit: the file is in a Mercator, as EPSG:3857 is, which draws lengths {stretch:.4g} times as long at "
        f"{abs(latitude):.0f}° {'N' if latitude > 0.0 else 'S'}: a unit of it is {metres / stretch:.6g} m, within "
        f"{100.0 * OFF:.1g} %; reproject it for more"
    )
    return f"{metres / stretch:.9g} m", [Note(UNIT, said)]


def layout_of_features(
    features: Sequence[Feature], path: Path, reading: Reading, system: System, skipped: Mapping[str, int]
) -> Layout:
    """Make a layout of polygons, and of the faces between lines; ``skipped`` counts by its kind what is no outline."""
    found, rows = Drawing(skipped=Counter(skipped)), _rows(features)
    roles = dict.fromkeys(row.pop("role") for row in rows if row.get("role", mechanics.FREE) not in mechanics.ROLES)
    for feature, row in zip(features, rows, strict=True):
        first = len(found.outlines)
        _add(feature.geometry, row, found)
        if len(parts := found.outlines[first:]) > 1:
            named = [{**row, "name": f"{row['name']} {k + 1}"} for k in range(len(parts))]
            found.outlines[first:] = [replace(one, row=own) for one, own in zip(parts, named, strict=True)]
    true, stretched = _true_unit(found, reading, system)
    turn, notes = found.turn(reading)
    in_plan = (turn == np.eye(3)).all()
    if stretched and not in_plan:
        raise ValueError(
            "its polygons stand upright in a Mercator, which stretches lengths but no heights; reproject it"
        )
    found.notes += notes
    if roles:
        listed = ", ".join(f"'{role}'" for role in roles)
        found.notes.append(Note(CHANGED, f"roles were left out ({listed}): roles are {', '.join(mechanics.ROLES)}"))
    unknown = not (system.unit or system.degrees or system.is_none)
    _check_degrees(found, path, reading, system.degrees, far=unknown and in_plan)
    found.notes += stretched
    with_faces(found, reading, row_of=lambda layers, name: _row(name, layers[-1], {}), in_place=True)
    refuse_open(found, "polygon", "one polygon", true)
    found.notes += passed_over(found.skipped)
    return found.layout(true)


def _add(geometry: Any, row: dict[str, Any], found: Drawing) -> None:
    kind = geometry.geom_type
    if geometry.is_empty:
        found.skipped["empty geometries"] += 1
    elif kind == "Polygon":
        ring, *holes = (_points(one)[:-1] for one in (geometry.exterior, *geometry.interiors))
        outline = Outline(points=ring, row=row, holes=tuple(holes))
        if holes:
            found.holed.append((outline, f"'{row['name']}'"))
        else:
            found.outlines.append(outline)
    elif kind in ("LineString", "LinearRing"):
        points, name = _points(geometry), row["name"]
        joined = joined_ends(points)
        if joined is None:
            layer, must_close = row.get("group", ""), len(points) > 2
            found.loose.append(Line(points=points, layer=layer, name=name, handle=name, must_close=must_close))
        else:
            found.outlines.append(Outline(points=joined[0], row=row))
            found.misses.append(joined[1])
    elif kind in ("MultiPolygon", "MultiLineString", "GeometryCollection"):
        for part in shapely.get_parts(geometry):
            _add(part, row, found)
    else:
        found.skipped[kind] += 1


def _points(line: Any) -> np.ndarray:
    """(n, 3) array: the points of a line; where it has no elevations they are 0."""
    points = shapely.get_coordinates(line, include_z=True)
    points[:, 2] = np.nan_to_num(points[:, 2])
    return np.asarray(points)


def _check_degrees(found: Drawing, path: Path, reading: Reading, system: str, *, far: bool) -> None:
    """Refuse longitudes and latitudes, with the command that turns them into metres; of places, if they are far."""
    rings = [one.points for one in (*found.outlines, *(one for one, _ in found.holed))]
    if not rings or (reading.unit is not None and not system):
        return
    median = float(np.median([math.sqrt(abs(ring_area(ring))) for ring in rings]))
    x, y = np.concatenate(rings).T
    # In metres no stone is as small, and in degrees none as large: 2 km.
    possible = np.abs(x).max() <= 360.0 and np.abs(y).max() <= 90.0
    if possible and (0.0 < median < DOUBTED[0] or (far and math.hypot(x.mean(), y.mean()) > FAR * np.ptp(x) > 0.0)):
        zone = int((x.mean() + 180.0) % 360.0 // 6.0) + 1
        code = (32600 if y.mean() >= 0.0 else 32700) + zone
        unless = "" if system else "; if they are no degrees, give their unit"
        # What the file says of its system, if anything, is then another one.
        from_degrees = "" if system else "-s_srs EPSG:4326 "
        raise ValueError(
            f"it is in degrees{f' ({system})' if system else ''}: its median block is {median:.2g} across, near "
            f"({x[0]:.6f}, {y[0]:.6f}); reproject it to metres: ogr2ogr {from_degrees}-t_srs EPSG:{code} "
            f"{path.stem}_m.gpkg {path.name}{unless}"
        )
    if system:
        found.notes.append(
            Note(
                CHANGED,
                f"the file says degrees ({system}), in which its median block would be {median * 111.0:.3g} km across; "
                f"its coordinates were read as lengths",
            )
        )


def _rows(features: Sequence[Feature]) -> list[dict[str, Any]]:
    """Write a row of the block table for each feature, of its attributes."""
    small = [{str(key).lower(): value for key, value in one.attributes.items()} for one in features]
    said = [{key: value for key, value in one.items() if value not in (None, "")} for one in small]
    name = _first(NAMES, said, distinct=len(said) > 1)
    group = _first(GROUPS, said, distinct=False)
    rows = []
    for k, (own, feature) in enumerate(zip(said, features, strict=True)):
        value = own.get(name, "")
        called = value if isinstance(value, str) and value else f"{name} {value}" if value != "" else f"block {k}"
        rows.append(_row(str(called), str(own.get(group, feature.layer)), own))
    return rows


def _first(keys: Iterable[str], rows: Sequence[Mapping[str, Any]], *, distinct: bool) -> str:
    """Choose the first key that a row has, or that has several values; "" for none."""
    values: Iterator[tuple[str, set[str]]] = ((key, {str(row[key]) for row in rows if key in row}) for key in keys)
    return next((key for key, one in values if len(one) > int(distinct)), "")


def _row(name: str, group: str, attributes: Mapping[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {"name": name, "group": group}
    material = str(attributes.get("material", "" if group.strip().lower() in mechanics.ROLES else group))
    role = str(attributes.get("role", "")).strip().lower()
    row |= {"material": material} if material else {}
    row |= {"role": ROLE_WORDS.get(role, role)} if role else {}
    return row | {key: attributes[key] for key in ("thickness", "density") if key in attributes}


def write(layout: Layout, path: Path) -> None:
    """Write GeoJSON: a polygon per block, lengths in m, no coordinate system."""
    features = [
        {"type": "Feature", "properties": row, "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}}
        for row, ring in zip(rows_of(layout), (ring.tolist() for ring in layout.outlines), strict=True)
    ]
    lines = ",\n  ".join(json.dumps(feature, ensure_ascii=False) for feature in features)
    head = '"type": "FeatureCollection", "crs": null'
    path.write_text(f'{{{head},\n "features": [\n  {lines}\n]}}\n', encoding="utf-8")
