"""The ground that blockvis new lays: a case stands at its first try, in the plane and in space."""

import csv
import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from structures import layout_of, run_command, upright

import solver
from blockvis import generators, write_layout
from blockvis.cli import main

WIDTH, HEIGHT, STONES = 0.5, 0.3, 4


def drawn(path, outlines, unit="m"):
    blocks = [{"name": f"s{k}", "role": "free", "outline": np.array(ring).tolist()} for k, ring in enumerate(outlines)]
    path.write_text(json.dumps({"format": "blockvis layout", "unit": unit, "blocks": blocks}), encoding="utf-8")
    return path


def without_supports(path, assembly, springers=False):
    """A drawing that says nothing of roles, names or layers; its springers are stones like the others."""
    layout = layout_of(assembly)
    layout = layout if springers else layout.chosen(np.flatnonzero(assembly.free))
    none = ("",) * layout.n_blocks
    names = tuple(f"b{k}" for k in range(layout.n_blocks))
    write_layout(replace(layout, names=names, groups=none, roles=none), path)
    return path


def wall(bottoms, joint=0.0, courses=3):
    """Ashlar whose lowest stones end at these corners: two or three for each."""
    rings = []
    for course in range(courses):
        shift = course % 2 * WIDTH / 2.0
        edges = np.unique(np.clip(np.arange(STONES + 2) * WIDTH - shift, 0.0, STONES * WIDTH))
        for k, (start, end) in enumerate(zip(edges[:-1] + joint / 2, edges[1:] - joint / 2, strict=True)):
            below = [course * HEIGHT + joint / 2] * 2 if course else bottoms[k]
            corners = zip(np.linspace(start, end, len(below)), below, strict=True)
            top = (course + 1) * HEIGHT - joint / 2
            rings.append([*corners, (end, top), (start, top)])
    return rings


def arch(first, last, voussoirs=9, radius=1.0, thickness=0.25):
    """Voussoirs between two angles in degrees."""
    angles = np.radians(np.linspace(last, first, voussoirs + 1))
    at = np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [radius * at[:-1], (radius + thickness) * at[:-1], (radius + thickness) * at[1:], radius * at[1:]]
    return np.stack(rings, axis=1)


def told(drawing, capsys, *options):
    """The values of the new case of a drawing, and what was said; it stands."""
    case = drawing.with_suffix(".toml")
    assert main(["new", str(drawing), "-o", str(case), *options], outputs=()) == 0
    out, err = capsys.readouterr()
    assert "it stands: first equilibrium found" in out, err
    return tomllib.loads(case.read_text(encoding="utf-8")), out + err


def ran(drawing):
    increment = tomllib.loads(drawing.with_suffix(".toml").read_text(encoding="utf-8"))["settlement"]["increment"]
    limit = f"settlement.limit={2.0 * increment}"
    return run_command(drawing.with_suffix(".toml"), "-o", drawing.parent / "out", "--force", "--set", limit)


def least_reaction(drawing):
    """[N], along the path of a run: below 0 where the ground holds a stone down."""
    with (drawing.parent / "out" / "response.csv").open(encoding="utf-8") as path:
        return min(float(row["least_admissible"]) for row in csv.DictReader(path))


def roles_of(values):
    """Names by role, of supports and of blocks."""
    every = [*values.get("roles", {}).items(), *((one["name"], one["role"]) for one in values.get("supports", ()))]
    return {role: {name for name, has in every if has == role} for role in ("fixed", "moving")}


def stands_off(values, rings):
    """The ground reaches into no stone, and its walls are off their sides by as much as they are high, or 5 % of a bed.

    The wall between the halves is within the ground.
    """
    stones = [shapely.Polygon(ring) for ring in rings]
    grounds = [np.array(one["outline"]) for one in values["supports"]]
    for ground in grounds:
        # Its line is simplified within rounding, 2e-6 of its depth.
        assert max(shapely.Polygon(ground).intersection(stone).area for stone in stones) < 1e-6
    between = grounds[0][:, 0].max()
    for start, end in ((ring, np.roll(ring, -1, axis=0)) for ring in grounds):
        for a, b in zip(start, end, strict=True):
            height = abs(b[1] - a[1])
            if height <= abs(b[0] - a[0]) or a[0] == b[0] == between:
                continue
            # Its upper end is below the stone that stands on it.
            wall = shapely.LineString([0.6 * a + 0.4 * b, 0.4 * a + 0.6 * b])
            assert min(wall.distance(stone) for stone in stones) > min(0.2 * height, 0.005)


def first_reaction(capsys):
    """[W]; it is the least, which nothing holds down."""
    return float(re.search(r"first reaction +\S+ N +(\S+) W", capsys.readouterr().out).group(1))


#: Lower ends of a course a few millimetres off level, as ashlar drawn from pixels.
OFF_LEVEL = [(0.0, 0.0), (0.004, 0.004), (0.002, 0.002), (0.004, 0.004)]


@pytest.mark.parametrize(
    ("bottoms", "joint", "reaction"),
    [
        ([(0.0, 0.0)] * STONES, 0.0, 0.2757),
        (OFF_LEVEL, 0.0, 0.2753),
        ([(0.03, 0.03), (0.0, 0.0), (0.03, 0.03), (0.004, 0.004)], 0.0, 0.2737),
        pytest.param(OFF_LEVEL, 0.01, 0.2753, marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_a_course_off_level_is_bedded_and_not_held(tmp_path, capsys, bottoms, joint, reaction):
    """Walls of ground of 2 mm beside its stones held them by friction: the first reaction was 0.496 W."""
    rings = wall(bottoms, joint)
    drawing = drawn(tmp_path / "wall.json", rings)
    values, _ = told(drawing, capsys)
    assert values["geometry"].get("joint_thickness") == ("auto" if joint else None)
    left, right = (np.array(one["outline"]) for one in values["supports"])
    assert left[:, 0].min() == pytest.approx(joint / 2 - 0.2)
    assert right[:, 0].max() == pytest.approx(STONES * WIDTH - joint / 2 + 0.2)
    stands_off(values, rings)
    ground = shapely.union_all([shapely.Polygon(left), shapely.Polygon(right)])
    for k, (below, _) in enumerate(bottoms):
        bed = shapely.LineString([[k * WIDTH, below - 1e-6], [(k + 1) * WIDTH, below - 1e-6]])
        assert bed.intersection(ground).length > 0.89 * WIDTH
    assert ran(drawing) == 0
    assert first_reaction(capsys) == pytest.approx(reaction, abs=2e-4)


def foundation(low, right, left):
    """Three narrow stones under a lintel, of which the middle one goes deeper, and bulges by so much to the sides."""
    middle = [
        [0.2, low],
        [0.4, low],
        [0.4 + right, -0.1],
        [0.4, 0],
        [0.4, 0.5],
        [0.2, 0.5],
        [0.2, 0],
        [0.2 - left, -0.1],
    ]
    sides = [[[x, 0], [x + 0.2, 0], [x + 0.2, 0.5], [x, 0.5]] for x in (0.0, 0.4)]
    return [*sides, middle, [[0, 0.5], [0.6, 0.5], [0.6, 0.7], [0, 0.7]]]


@pytest.mark.parametrize(
    ("low", "right", "left"),
    [
        (-0.22, 0.015, 0.015),
        pytest.param(-0.24, 0.02, 0.0, marks=pytest.mark.thorough),
        pytest.param(-0.22, 0.0, 0.0, marks=pytest.mark.thorough),
    ],
)
def test_feet_beside_a_lower_one_keep_their_beds(tmp_path, capsys, low, right, left):
    """The ground was cut back at 45 degrees from a bulge, to the top of all, and those beside it fell."""
    rings = foundation(low, right, left)
    drawing = drawn(tmp_path / "wall.json", rings)
    values, _ = told(drawing, capsys)
    stands_off(values, rings)
    ground = shapely.union_all([shapely.Polygon(one["outline"]) for one in values["supports"]])
    for start, end in ((0.0, 0.2 - left), (0.4 + right, 0.6)):
        bed = shapely.LineString([[start, -1e-6], [end, -1e-6]])
        assert bed.intersection(ground).length >= 0.94 * (end - start)


@pytest.mark.thorough
@settings(max_examples=25, deadline=None, derandomize=True, database=None)
@given(st.lists(st.tuples(st.floats(0.0, 0.14), st.floats(0.0, 0.06)), min_size=3, max_size=3))
def test_no_ground_under_feet_at_any_heights_holds_a_stone(tmp_path_factory, feet):
    """A lower stone bulges beneath the bed of the one beside it."""
    lows, bulges = zip(*feet, strict=True)
    rings = []
    for k, low in enumerate(lows):
        sides = []
        for x, other in ((0.4 * k, k - 1), (0.4 * k + 0.4, k + 1)):
            step = lows[other] - low if 0 <= other < len(lows) else 0.0
            out = np.sign(other - k) * bulges[k]
            sides.append([[x + out, low + 0.5 * step], [x, low + step]] if step > 1e-3 else [])
        ends = [[0.4 * k, low], [0.4 * k + 0.4, low]]
        rings.append([*ends, *sides[1], [0.4 * k + 0.4, 0.4], [0.4 * k, 0.4], *sides[0][::-1]])
    rings.append([[0.0, 0.4], [1.2, 0.4], [1.2, 0.6], [0.0, 0.6]])
    drawing = drawn(tmp_path_factory.mktemp("feet") / "wall.json", rings)
    case = drawing.with_suffix(".toml")
    assert main(["new", str(drawing), "-o", str(case)], outputs=()) == 0
    stands_off(tomllib.loads(case.read_text(encoding="utf-8")), rings)
    assert ran(drawing) == 0
    assert least_reaction(drawing) > 0.0


@pytest.mark.thorough
def test_a_pad_in_space_stands_off_from_a_lower_stone(tmp_path, capsys):
    """It reached into the bulge of the stone beside it, and was refused."""
    solids = [upright(ring, 0.0, 0.4) for ring in foundation(-0.22, 0.015, 0.015)[:3]]
    lintel = foundation(-0.22, 0.0, 0.0)[3]
    solids += [upright(lintel, 0.0, 0.2), upright(lintel, 0.2, 0.4)]
    drawing = without_supports(tmp_path / "stones.obj", solver.Assembly.from_solids(solids))
    values, said = told(drawing, capsys)
    assert "overlap" not in said
    left, right = (np.array(one["outline"]) for one in values["supports"] if one["levels"][1] == 0.0)
    assert 0.15 < left[:, 0].max() < 0.185 - 0.005
    assert 0.415 + 0.005 < right[:, 0].min() < 0.45


#: A stone whose toe sticks out by 5 mm under its neighbour, which ends lower on its other side.
TOED = (
    [[0, 0], [1, 0], [1, 0.5], [0, 0.5]],
    [[1, 0], [1.995, 0.0085], [2, 0.01], [2, 0.5], [1, 0.5]],
    [[1.995, 0.001], [3, 0.002], [3, 0.5], [2, 0.5], [2, 0.01]],
    [[0, 0.5], [3, 0.5], [3, 1], [0, 1]],
)


@pytest.mark.thorough
def test_the_ground_does_not_close_over_a_toe(tmp_path, capsys):
    """A tongue over it would hold the stone down: the least reaction was -0.295 W."""
    drawing = drawn(tmp_path / "wall.json", TOED)
    values, _ = told(drawing, capsys)
    stands_off(values, TOED)
    assert ran(drawing) == 0
    assert first_reaction(capsys) == pytest.approx(0.1223, abs=1e-3)


def test_supports_that_hold_down_what_they_bear_are_doubted(tmp_path, capsys):
    """As the ground with a tongue that was once laid under a toe."""
    left = [[-0.5, -0.5], [1.5, -0.5], [1.5, 0.00427135678], [1, 0], [-0.5, 0]]
    right = [[1.5, -0.5], [3.5, -0.5], [3.5, 0.002], [3, 0.002], [1.995, 0.001]]
    right += [[2, 0.01], [1.995, 0.0085], [1.5, 0.00427135678]]
    blocks = [
        *({"outline": ring} for ring in TOED),
        {"name": "left", "role": "fixed", "outline": left},
        {"name": "right", "role": "moving", "outline": right},
    ]
    (tmp_path / "wall.json").write_text(json.dumps({"unit": "m", "blocks": blocks}), encoding="utf-8")
    case = tmp_path / "wall.toml"
    case.write_text(
        '[geometry]\nfile = "wall.json"\n[settlement]\ndirection = [0, -1]\nincrement = 0.01\nlimit = 0.01\n'
        "[material]\nfriction_coefficient = 0.6\n",
        encoding="utf-8",
    )
    assert run_command(case, "-o", tmp_path / "out") == 0
    out = capsys.readouterr().out
    assert re.search(r"first reaction +-17\d\d\d", out)
    assert "below 0 these supports, which sink, hold the structure down: doubt faces" in out


def test_outlines_that_turn_clockwise_lie_on_their_ground(tmp_path, capsys):
    """Finer than needed, they are simplified as in a run, which drops other corners from another one on."""
    rng = np.random.default_rng(21)
    rings = []
    for ring in np.array(wall([(0.0, 0.0)] * STONES, courses=1)):
        (left, low), (right, top) = ring.min(axis=0), ring.max(axis=0)
        x = np.repeat(np.linspace(left, right, 33), 2)[1:-1]
        stairs = np.column_stack([x, np.repeat(low + 0.005 * rng.integers(0, 3, 32), 2)])
        rings.append(np.vstack([stairs, [[right, top], [left, top]]])[::-1])
    assert "overlap" not in told(drawn(tmp_path / "wall.json", rings), capsys)[1]


@pytest.mark.thorough
@settings(max_examples=8, deadline=None, derandomize=True, database=None)
@given(
    st.lists(st.floats(0.0, 0.99 * HEIGHT / 2), min_size=3 * STONES, max_size=3 * STONES), st.sampled_from([0.0, 0.02])
)
def test_rubble_whose_bottoms_lie_within_half_a_stone_stands(tmp_path_factory, bottoms, joint):
    rings = wall(np.reshape(bottoms, (STONES, 3)), joint)
    drawing = drawn(tmp_path_factory.mktemp("rubble") / "wall.json", rings)
    assert main(["new", str(drawing), "-o", str(drawing.with_suffix(".toml"))], outputs=()) == 0
    assert ran(drawing) == 0
    assert least_reaction(drawing) > 0.0


@pytest.mark.parametrize("rise", [30.0, pytest.param(70.0, marks=pytest.mark.thorough)])
def test_springers_on_a_slope_become_supports(tmp_path, capsys, rise):
    drawing = drawn(tmp_path / "arch.json", arch(rise, 180.0 - rise))
    values, _ = told(drawing, capsys)
    assert values["roles"] == {"s0": "fixed", "s8": "moving"}
    assert "supports" not in values
    assert ran(drawing) == 0


@pytest.mark.thorough
def test_an_arch_of_which_one_end_is_level_and_higher(tmp_path, capsys):
    values, _ = told(drawn(tmp_path / "arch.json", arch(0.0, 165.0)), capsys)
    assert values["roles"] == {"s0": "fixed"}
    assert [one["role"] for one in values["supports"]] == ["moving"]


def test_gaps_of_rounding_are_no_mortar(tmp_path, capsys):
    values, _ = told(drawn(tmp_path / "wall.json", wall([(0.0, 0.0)] * STONES, joint=1.7e-7)), capsys)
    assert "joint_thickness" not in values["geometry"]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["pointed arch", "basket-handle arch", "arch on piers", "arch", "panel"])
def test_arches_and_walls_of_the_plane(tmp_path, capsys, name):
    drawing = without_supports(tmp_path / "drawing.json", generators.build(name, {}))
    told(drawing, capsys)
    assert ran(drawing) == 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "parameters", "moving"),
    [
        ("barrel vault", {"voussoirs": 8, "stones": 2}, 1),
        ("barrel vault", {"voussoirs": 8, "stones": 2, "embrace": 120.0}, None),
        ("dome", {"courses": 3}, 1),
        ("dome", {"courses": 3, "springing": 60.0}, 4),
        ("cross vault", {"voussoirs": 7}, 1),
        ("L corner", {"bricks": 2, "across": 2, "courses": 3}, 1),
    ],
)
def test_vaults_and_walls_in_space(tmp_path, capsys, name, parameters, moving):
    drawing = without_supports(tmp_path / "drawing.obj", generators.build(name, parameters))
    values, _ = told(drawing, capsys)
    roles = roles_of(values)
    assert roles["fixed"]
    assert moving is None or len(roles["moving"]) == moving
    assert ran(drawing) == 0


@pytest.mark.thorough
def test_all_springers_of_one_side_of_a_vault_move(tmp_path, capsys):
    """A barrel with its springers drawn, three along each side."""
    vault = generators.build("barrel vault", {"embrace": 120.0, "voussoirs": 5, "stones": 1, "springers": 3})
    drawing = without_supports(tmp_path / "vault.obj", vault, springers=True)
    roles = roles_of(told(drawing, capsys)[0])
    sides = [np.sign(vault.centroids[[int(name[1:]) for name in roles[role]], 0]) for role in ("fixed", "moving")]
    assert [sorted(side) for side in sides] == [[-1.0] * 3, [1.0] * 3]


@pytest.mark.parametrize(
    ("name", "parameters", "moving"),
    [
        ("barrel vault", {"embrace": 120.0, "voussoirs": 5, "stones": 1, "springers": 3}, 3),
        # Two of four corners, and half of a ring.
        pytest.param("cross vault", {"voussoirs": 5}, 2, marks=pytest.mark.slow),
        pytest.param("dome", {"courses": 3}, 4, marks=pytest.mark.slow),
    ],
)
def test_the_supports_that_a_drawing_has_move_by_sides(tmp_path, capsys, name, parameters, moving):
    vault = generators.build(name, parameters)
    layout = layout_of(vault)
    names = tuple(f"b{k}" for k in range(layout.n_blocks))
    roles = tuple("free" if free else "fixed" for free in vault.free)
    drawing = tmp_path / "vault.json"
    write_layout(replace(layout, names=names, roles=roles, groups=("",) * layout.n_blocks), drawing)
    values, _ = told(drawing, capsys)
    assert set(values["roles"].values()) == {"moving"}
    assert {np.sign(vault.centroids[int(name[1:]), 0]) for name in values["roles"]} == {1.0}
    assert len(values["roles"]) == moving


@pytest.mark.slow
def test_what_does_not_stand_is_named_with_its_cause_and_marked(tmp_path, capsys):
    hanging = [(3.0, 1.0), (3.4, 1.0), (3.4, 1.2), (3.0, 1.2)]
    # A letter below the wall, under which the only ground was laid.
    letter = [(1.0, -0.6), (1.05, -0.6), (1.05, -0.55), (1.0, -0.55)]
    drawing = drawn(tmp_path / "wall.json", [*wall([(0.0, 0.0)] * STONES), hanging, letter])
    assert main(["new", str(drawing), "-o", str(tmp_path / "wall.toml")]) == 0
    pixels = np.asarray(Image.open(tmp_path / "wall.supports.png").convert("RGB"))
    assert (pixels == (244, 176, 97)).all(axis=2).sum() > 1000
    said = capsys.readouterr().err
    assert "2 of 15 blocks fall ('s13', 's14'), and would stand with " in said
    assert "; 2 of them touch nothing that stands ('s13', 's14')" in said


@pytest.mark.parametrize(
    ("causes", "words"),
    [
        (("hangs", "tips"), "1 of them touch nothing that stands .'s13'.: .*; the others fall for another reason"),
        (
            ("rests", "slides", "tips"),
            r"1 of them \('s15'\) tip or drop whatever .*; the others slide",
        ),
    ],
)
@pytest.mark.slow
def test_blocks_that_fall_for_another_reason_are_not_left_out(tmp_path, capsys, causes, words):
    stones = {
        "hangs": [(3.0, 1.0), (3.4, 1.0), (3.4, 1.2), (3.0, 1.2)],
        "tips": [(1.9, 0.9), (2.6, 0.9), (2.6, 1.1), (1.9, 1.1)],
        "rests": [(-3.0, 0.0), (-2.0, 0.0), (-2.0, 1.4), (-3.0, 0.4)],
        "slides": [(-2.8, 0.6), (-2.4, 1.0), (-2.6, 1.2), (-3.0, 0.8)],
    }
    drawing = drawn(tmp_path / "wall.json", [*wall([(0.0, 0.0)] * STONES), *(stones[cause] for cause in causes)])
    assert main(["new", str(drawing), "-o", str(tmp_path / "wall.toml")]) == 0
    assert re.search(words, capsys.readouterr().err)


def test_a_unit_in_doubt_is_replaced_and_said_above_its_line(tmp_path, capsys):
    """An SVG of bricks 250 wide whose file states no unit that makes them masonry."""
    rectangle = '<rect x="{}" y="0" width="250" height="100"/>'
    text = "".join(rectangle.format(250 * k) for k in range(4))
    (tmp_path / "wall.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{text}</svg>', encoding="utf-8")
    values, said = told(tmp_path / "wall.svg", capsys)
    assert values["geometry"]["unit"] == "mm"
    assert "unit m in doubt" in said
    lines = (tmp_path / "wall.toml").read_text(encoding="utf-8").splitlines()
    above = lines[lines.index('unit = "mm"') - 3 : lines.index('unit = "mm"')]
    assert "the file is read in mm here" in " ".join(line[2:] for line in above)
