"""A structure: blocks with their joints and loads, and what is asked of it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import blockvis
import solver
from blockvis import generators
from solver import mechanics

#: A block twice as high as wide overturns at a horizontal acceleration of its slenderness, 0.5 g, unless it slides.
GROUND = [[-1, -0.2], [3, -0.2], [3, 0], [-1, 0]]
BLOCK = [[0, 0], [1, 0], [1, 2], [0, 2]]


@pytest.fixture
def block() -> solver.Assembly:
    return solver.Assembly.from_outlines([GROUND, BLOCK], roles=["fixed", "free"])


@pytest.mark.parametrize(("friction", "multiplier"), [(0.7, 0.5), (0.3, 0.3)])
def test_acceleration_at_which_a_block_overturns_or_slides(block, friction, multiplier):
    structure = solver.Structure(block, friction_coefficient=friction)
    for acceleration in ((1, 0), (-1, 0)):
        limit = structure.limit_load(acceleration=acceleration)
        assert limit.multiplier == pytest.approx(multiplier, rel=1e-6)
        assert structure.with_live(acceleration=acceleration).limit_load().multiplier == limit.multiplier


def test_loads_may_be_lists(block):
    dead = solver.self_weight(block).dead
    live = solver.weight_fraction(block, (1, 0))
    found = solver.limit_load(block, loads=solver.Loads(dead.tolist(), live.tolist()), friction_coefficient=0.7)
    assert found.multiplier == pytest.approx(0.5, rel=1e-6)


def test_a_structure_keeps_the_loads_that_it_was_made_of(block):
    dead, live = solver.self_weight(block).dead, solver.weight_fraction(block, (1, 0))
    structure = solver.Structure(block, loads=solver.Loads(dead, live), friction_coefficient=0.7)
    live *= 2.0
    dead *= 3.0
    assert structure.limit_load().multiplier == pytest.approx(0.5, rel=1e-6)


def test_ties_changes_fills_and_forces_keep_what_they_were_made_of(block):
    """Of two ties made in one array both were at the second, and a finished response changed its loads."""
    removed, thin, dead, arms = np.zeros(2, dtype=bool), np.zeros(2), np.zeros((2, 3)), np.zeros((2, 2, 2))
    ends = np.array([[0.5, 1.0], [5.0, 1.0]])
    change = solver.PhaseChange(0, removed=removed, dead=dead, dead_arms=arms, ties=["rod"])
    fill = solver.Backfill(pieces=arms, block=np.zeros(2, dtype=int), surface=1.0, unit_weight=1.0, thickness=thin)
    rod, forces = solver.Tie("rod", (1, None), ends, 1e6), solver.PointForces([0, 0], thin, ends)
    for array in (removed, thin, dead, arms, ends):
        array[:] = 7.0
    for kept in (change.removed, change.dead, change.dead_arms, fill.pieces, fill.thickness, forces.force):
        assert not kept.any()
    assert rod.points == ((0.5, 1.0), (5.0, 1.0)) == tuple(map(tuple, forces.point.tolist()))
    assert (change.removed.dtype, change.ties) == (bool, ("rod",))


def test_a_settlement_tells_that_it_leaves_live_loads_out(block):
    moving = block.with_roles(["moving", "free"])
    structure = solver.Structure(moving, friction_coefficient=0.7).with_live(acceleration=(9, 0))
    with pytest.warns(UserWarning, match="a settlement leaves the live loads out"):
        assert structure.settle(solver.Settlement((0, -1), increment=1, limit=1)).load_multiplier.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("rotations", "message"),
    [
        (np.zeros(2), r"rotations of shape \(2,\); give d and d \(d - 1\) / 2 numbers per block"),
        ([[0.0], [np.nan]], r"the pose of block 1 is .*nan.*; not finite"),
        ("x", "rotations is 'x'; give numbers"),
    ],
)
def test_a_pose_that_is_none_is_refused(block, rotations, message):
    with pytest.raises(ValueError, match=message):
        solver.Pose(block.centroids, rotations)
    assert solver.Pose(block.centroids.tolist(), [[0], [0]]).rotations.dtype == float


def test_blocks_inside_each_other_at_a_pose_are_told(block):
    structure = solver.Structure(block, friction_coefficient=0.7)
    sunk = solver.Pose(block.centroids - [[0, 0], [0, 0.15]], np.zeros((2, 1)))
    limit = structure.limit_load(acceleration=(1, 0), pose=sunk)
    assert "blocks overlap by up to 0.15 m at this pose" in str(limit)


def test_what_holds_arrays_is_equal_to_itself_alone(block):
    """Comparing arrays ended in words of numpy; now a structure is found in a list, and is a key."""
    structure = solver.Structure(block, friction_coefficient=0.7)
    response = structure.limit_load(acceleration=(1, 0)).response
    force, limit = solver.PointForces.at(1, (0, -1), (0.5, 2)), structure.limit_load(acceleration=(1, 0))
    values = [block, structure, response, structure.loads, solver.Pose.initial(block), force, limit, limit.ties]
    values += [structure.envelope([0.5], lambda x: force), solver.PhaseChange(0, removed=[False] * 2), limit.increment]
    for one in values:
        assert {one: [one].index(one)}[one] == 0
        assert one != replace(one) or one in (structure, limit, limit.increment)


def test_blocks_are_counted_from_the_end_too(block):
    assert np.array_equal(block.outline(-1), block.outline(1))
    with pytest.raises(IndexError):
        block.outline(2)


def test_friction_is_never_assumed(block):
    with pytest.raises(TypeError, match="either a friction_coefficient or interfaces"):
        solver.Structure(block)
    with pytest.raises(TypeError, match="either a friction_coefficient or interfaces"):
        solver.Structure(block, solver.Interfaces(), friction_coefficient=0.5)
    with pytest.raises(ValueError, match="friction_coefficient is -1"):
        solver.Structure(block, friction_coefficient=-1.0)
    with pytest.raises(ValueError, match=r"is \[1.0, 0.0, 0.0\]; give 2 numbers, one per axis"):
        solver.Structure(block, friction_coefficient=0.5).limit_load(acceleration=(1, 0, 0))
    with pytest.raises(TypeError, match="either the live loads or an acceleration"):
        solver.Structure(block, friction_coefficient=0.5).with_live()
    assert solver.Structure(block, friction_coefficient=0.0).interfaces.default.friction_coefficient == 0.0


@pytest.mark.slow
def test_structure_and_functions_give_the_same():
    arch = generators.arch()
    spread = solver.Settlement(direction=(1, 0))
    by_name = solver.Structure(arch, friction_coefficient=2.0).settle((1, 0))
    by_function = solver.settle(arch, spread, friction_coefficient=2.0)
    assert by_name.collapse.bracket == by_function.collapse.bracket
    assert by_name.settlements == (spread,)


def test_limit_load_is_a_response_of_its_own(block, tmp_path):
    limit = solver.Structure(block, friction_coefficient=0.7).limit_load(acceleration=(1, 0))
    response = limit.response
    assert response.limits == (limit,)
    assert response.values == pytest.approx([0.5])
    assert response.loads.live[1, 0] == pytest.approx(mechanics.total_weight(block))
    assert "0.5" in limit.plot()._repr_html_()
    picture = blockvis.draw_mechanism(limit, tmp_path / "mechanism.png")
    assert picture.stat().st_size > 10_000
    blockvis.write(response, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "summary.json").read_bytes())["limit_load_multiplier"] == pytest.approx(0.5)


def test_what_is_analysed_shows_itself_in_a_notebook():
    structure = solver.Structure(generators.arch(), friction_coefficient=2.0)
    assert "<svg" in structure._repr_html_()
    assert "<svg" in structure.plot()._repr_html_()
    assert repr(structure) == f"<Structure of {structure.assembly.n_blocks} blocks>"


def test_increments_are_asked_for_and_then_how_it_ended():
    arch = generators.arch()
    increments = mechanics.settlement_increments(
        arch,
        [solver.Settlement(direction=(1, 0), increment=0.01, limit=0.02)],
        interfaces=solver.Interfaces(),
        loads=solver.self_weight(arch),
    ).begin()
    with pytest.raises(RuntimeError, match="has not ended"):
        _ = increments.ending
    assert [increment.parameter for increment in increments] == pytest.approx([0.0, 0.01, 0.02])
    assert increments.ending.stop is solver.Status.LIMIT_REACHED
    assert next(increments, None) is None
    assert increments.ending.stop is solver.Status.LIMIT_REACHED


def test_public_names_are_all_that_is_seen():
    assert {name for name in dir(blockvis) if not name.startswith("__")} == {*blockvis.__all__, "generators"}
    assert blockvis.generators is generators


class _Mesh:
    """What COMPAS writes of a mesh, in memory."""

    def __init__(self, name: str, low: float) -> None:
        corners = [[x, y, low + z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        self.data = {
            "dtype": "compas.datastructures/Mesh",
            "name": name,
            "data": {
                "vertex": {str(k): dict(zip("xyz", p, strict=True)) for k, p in enumerate(corners)},
                "face": {str(k): f for k, f in enumerate(faces)},
            },
        }

    def to_jsonstring(self) -> str:
        return json.dumps(self.data)


def test_meshes_of_compas_in_memory_become_blocks():
    meshes = [_Mesh("ground", 0), _Mesh("block", 1)]
    assembly = blockvis.from_compas(meshes, roles={"ground": "fixed"}, dimension=3)
    assert assembly.names == ("ground", "block")
    assert list(assembly.roles) == ["fixed", "free"]
    assert solver.Structure(assembly, friction_coefficient=0.4).limit_load(
        acceleration=(1, 0, 0)
    ).multiplier == pytest.approx(0.4, rel=1e-4)
    with pytest.raises(TypeError, match="str is no object of COMPAS"):
        blockvis.from_compas([*meshes, "wall"])


def test_messages_on_a_model_in_memory_name_no_file():
    with pytest.raises(ValueError, match=r"^.the model.: block .* overlaps block 1"):
        blockvis.from_compas([_Mesh("ground", 0), _Mesh("block", 0.5)])
    with pytest.warns(UserWarning, match=r"^the model: 1 overlap"):
        assert blockvis.from_compas([_Mesh("ground", 0), _Mesh("block", 0.999)]).n_blocks == 2


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (None, "NoneType is no object"),
        ("wall.json", "'wall.json' is no object .* use blockvis.read"),
        ([], "an empty list is no"),
    ],
)
def test_what_is_no_model_of_compas_is_named(model, said):
    with pytest.raises(TypeError, match=said):
        blockvis.from_compas(model)


def test_laws_of_what_is_not_there_are_refused(block):
    law = solver.InterfaceLaw(0.1)
    with pytest.raises(
        ValueError, match=r"no block is of the material 'brik' of the pairs of interfaces; there are \[''\]"
    ):
        solver.Structure(block, solver.Interfaces(law, {("brik", ""): law}))
    for name in ("nobody", "block 1"):
        with pytest.raises(ValueError, match=f"no support is named '{name}', whose ground has a stiffness"):
            solver.Structure(block, solver.Interfaces(law, ground={name: 1e8}))


@pytest.mark.parametrize(("factor", "told"), [(-1.0, "-1"), (np.nan, "nan"), (np.inf, "inf")])
def test_factors_of_friction_that_are_none_are_refused(block, factor, told):
    scatter = solver.JointScatter(1, lambda p: factor + 0.0 * p)
    structure = solver.Structure(block, solver.Interfaces(scatter=scatter))
    with pytest.raises(ValueError, match=f"scatter gives the factor {told}; it must be at least 0"):
        structure.limit_load(acceleration=(1, 0))


def test_a_pose_of_other_blocks_is_refused(block):
    structure = solver.Structure(block, friction_coefficient=0.5)
    pose = solver.Pose.initial(generators.arch())
    live = structure.with_live(acceleration=(1, 0))
    for analyse in (live.limit_load, lambda pose: live.pushover(solver.ControlDisplacement("block 1"), pose=pose)):
        with pytest.raises(ValueError, match=r"the pose is of another structure: its positions have shape \(14, 2\)"):
            analyse(pose=pose)


@pytest.mark.thorough
def test_what_has_no_equilibrium_has_no_first_reaction():
    loose = solver.Assembly.from_outlines([GROUND, BLOCK, [[5, 5], [6, 5], [6, 6]]], roles=["moving", "free", "free"])
    response = solver.settle(loose, solver.Settlement((0, -1)))
    assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
    assert np.isnan(response.initial_reaction)


def test_dead_loads_without_mass_are_told_of_an_acceleration(block):
    dead = solver.self_weight(block).with_forces(block, solver.PointForces.at(1, (0.0, -500.0), (0.5, 1.0)))
    structure = solver.Structure(block, loads=dead, friction_coefficient=0.5)
    with pytest.warns(UserWarning, match="500 N of other dead loads on them have no mass"):
        structure.limit_load(acceleration=(1, 0))


def test_a_dead_acceleration_has_mass(block, recwarn):
    dead = solver.self_weight(block).with_acceleration(block, (0.0, -0.2), "dead")
    structure = solver.Structure(block, loads=dead, friction_coefficient=0.5)
    assert structure.limit_load(acceleration=(1, 0)).multiplier == pytest.approx(0.5 * 1.2)
    assert not len(recwarn)
