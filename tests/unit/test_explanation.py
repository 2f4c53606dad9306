"""Candidates that open the same cracks, the comparison with observations, and Bayes' rule over what is left open."""

import time
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import structures

import blockvis
import solver
from blockvis import generators
from blockvis.cases.explain_settings import ExplainSettings
from blockvis.explanation import ranking
from blockvis.explanation.candidates import (
    candidates_of,
    ground_of,
    opens_cracks,
    per_amount,
    refined,
    trough,
    twins_of,
)
from blockvis.explanation.forward import (
    AS_FAR,
    ENOUGH,
    FARTHEST,
    LEANING,
    Variant,
    ordered,
    reach_of,
    workers_for,
)
from blockvis.explanation.likelihood import Comparison, Trust
from blockvis.explanation.observations import read_observations
from solver import mechanics

CASE = structures.Path("case.toml")
ARCH = generators.arch(voussoirs=6)
TRUST = Trust(0.25, 0.05, 0.05)


def candidates(assembly, **settings):
    ground = ground_of(assembly, ExplainSettings(**settings), CASE)
    return ground, candidates_of(ground, ExplainSettings(**settings), CASE)


def test_springers_go_down_apart_together_and_turn():
    ground, found = candidates(ARCH)
    assert not ground.troughs
    assert [one.cause for one in found if "left springer" in one.cause] == [
        "left springer moves down",
        "left springer moves left",
        "left springer moves right",
        "left springer turns counter-clockwise",
        "left springer turns clockwise",
    ]
    assert len(found) == 10


def test_movements_that_differ_by_a_translation_of_everything_are_twins():
    ground, found = candidates(ARCH)
    names = [one.cause for one in found]
    twins = twins_of(ground.assembly, found)
    for name, other in (
        ("right springer moves right", "left springer moves left"),
        ("right springer moves left", "left springer moves right"),
    ):
        twin = twins[names.index(name)]
        assert names[twin.of] == other
        assert twin.scale == pytest.approx(1.0)
        sign = 1.0 if name.endswith("right") else -1.0
        np.testing.assert_allclose(twin.travel, [sign, 0.0], atol=1e-12)
    down = [twins[names.index(f"{side} springer moves down")].of for side in ("left", "right")]
    assert down == [names.index("left springer moves down"), names.index("right springer moves down")]


def test_a_support_turns_about_the_middle_of_where_it_carries():
    _, found = candidates(ARCH, directions=("rotation",))
    turn = next(one for one in found if one.cause == "left springer turns counter-clockwise")
    contacts = mechanics.find_contacts(ARCH, ARCH.vertices, 1e-4)
    block = ARCH.index("left springer")
    here = contacts.points[(contacts.block_a == block) | (contacts.block_b == block)]
    case = structures.case_from('[geometry]\nlayout = "arch"\n[settlement]\ndirection = [0, -1]\n')
    order = ordered(case, ARCH, turn.motions, Variant(0.6), (0.02, 0.01))
    start, after = (order.settlement.displaced(order.given.assembly, solver.Pose.initial(ARCH), s) for s in (0.0, 0.01))
    moved = mechanics.carried(here, np.full(len(here), block), start, after) - here
    np.testing.assert_allclose(after.rotations[block], 0.01)
    np.testing.assert_allclose(moved.mean(axis=0), 0.0, atol=1e-12)


VAULT = generators.cross_vault(span=4.0, rise=1.5, thickness=0.3, voussoirs=5, stone=1.4)


@pytest.mark.thorough
def test_supports_in_space_sink_spread_and_tilt_and_are_said_where_they_go():
    ground, found = candidates(VAULT)
    causes = {one.cause: one for one in found}
    assert len(causes) == len(found) == 4 * (2 + 4 + 4) + 1
    level = 0.5**0.5
    assert causes["springer 1 moves down"].motions == {"springer 1": (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)}
    assert causes["springer 1 moves to the back"].motions["springer 1"][:3] == (0.0, 1.0, 0.0)
    np.testing.assert_allclose(causes["springer 3 moves outward"].motions["springer 3"][:3], [-level, -level, 0.0])
    assert set(causes["all supports move outward"].motions) == {f"springer {k}" for k in range(1, 5)}
    tilted = causes["springer 1 tilts to the right"]
    assert tilted.motions["springer 1"][3:] == (0.0, 1.0, 0.0)
    assert per_amount(ground.assembly, tilted)[1] == "rad"
    assert tilted.motions["springer 1"][:3] == (0.0, 0.0, 0.0), "it turns about where it carries"
    nearer = refined(ground, [causes["springer 1 moves down"]], found)
    assert "springer 1 moves down and to the front" in {one.cause for one in nearer}


def test_many_supports_in_space_sink_or_move_outward():
    _, found = candidates(generators.dome(lunes=6, courses=1))
    assert len(found) == 2 * 6 + 1


def test_words_of_space_are_refused_in_the_plane_and_troughs_in_space():
    with pytest.raises(ValueError, match=r"\[explain\] directions: 'front' is of structures in space"):
        candidates(ARCH, directions=("front",))
    with pytest.raises(ValueError, match=r"\[explain\] centres is of structures in the plane"):
        candidates(VAULT, centres=(1.0,))


def test_a_width_at_a_place_in_space_is_that_of_the_two_faces_there():
    joints = Comparison(
        VAULT, read_observations([{"joint": "groin 1-1 | groin 1-2", "width": 1e-3}], VAULT), TRUST
    ).joints
    joint = int(np.argmax(joints.sizes))
    names = [VAULT.names[k] for k in (joints.block_a[joint], joints.block_b[joint])]
    ring = joints.rings.points[joints.rings.offsets[joint] : joints.rings.offsets[joint + 1]]
    place = 0.7 * ring[0] + 0.3 * ring.mean(axis=0)
    row = {"joint": " | ".join(names), **dict(zip("xyz", place, strict=True)), "width [mm]": 3.0}
    compared = Comparison(VAULT, read_observations([row], VAULT), TRUST)
    np.testing.assert_allclose(compared.observations.places[0], place, atol=1e-12)
    # A gap that grows evenly along x, y and z has at the place what it has there.
    gaps = (joints.rings.points - joints.rings.points.min(axis=0)) @ [1e-3, 2e-3, 3e-3]
    there = (place - joints.rings.points.min(axis=0)) @ [1e-3, 2e-3, 3e-3]
    pair = int(np.flatnonzero(compared.joint == joint)[0])
    assert compared.widths(gaps[None])[0, pair] == pytest.approx(there)


def test_a_point_in_space_turns_with_its_block():
    row = {"block": "keystone", "x": 0.5, "y": 0.0, "z": 1.6, "dx": 0.0, "dy": 0.0, "dz": -0.01}
    compared = Comparison(VAULT, read_observations([row], VAULT), TRUST)
    block = VAULT.index("keystone")
    moved = np.zeros((1, VAULT.n_blocks, 6))
    moved[0, block] = [0.0, 0.0, -0.01, 0.0, 0.0, np.pi / 2.0]
    x, y = np.array([0.5, 0.0]) - VAULT.centroids[block, :2]
    np.testing.assert_allclose(compared.displacements(moved)[0, 0], [-y - x, x - y, -0.01], atol=1e-12)


def test_supports_that_move_together_open_nothing():
    ground, found = candidates(ARCH, supports=(("left springer", "right springer"),), directions=("down",))
    assert not opens_cracks(ground.assembly, found[0])


def test_a_wall_on_one_ground_has_troughs_and_slopes():
    wall = generators.wall(bricks=3, courses=2, settling=[0.0, 0.75])
    ground, found = candidates(wall)
    assert ground.troughs
    assert {one.cause for one in found} == {
        "a trough of the ground",
        "the ground slopes down to the left",
        "the ground slopes down to the right",
    }
    assert len(ground.pieces["ground"]) == 5


def test_around_the_best_lie_movements_between_two_directions_and_nearer_troughs():
    ground, found = candidates(ARCH)
    best = [one for one in found if one.cause == "left springer moves left"]
    assert [one.cause for one in refined(ground, best, found)] == ["left springer moves down and left"]
    wall = generators.wall(bricks=3, courses=2, settling=[0.0, 0.75])
    ground, found = candidates(wall)
    trough = next(one for one in found if one.is_trough)
    nearer = refined(ground, [trough], found)
    assert len(nearer) == 8
    assert all(one.is_trough and one.refines == trough.detail for one in nearer)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"supports": (("left spring",),)}, r"supports: 'left spring' is no block \(did you mean 'left springer'\?\)"),
        ({"supports": (("voussoir 1",),)}, "'voussoir 1' is a free block"),
    ],
)
def test_a_support_that_there_is_not_is_named(settings, words):
    with pytest.raises(ValueError, match=words):
        candidates(ARCH, **settings)


def test_a_structure_on_one_block_has_nothing_that_can_move_against_another():
    column = generators.column(blocks=2)
    with pytest.raises(ValueError, match="there is one support"):
        candidates(column)
    free = column.with_roles(["free"] * column.n_blocks)
    with pytest.raises(ValueError, match="no block is a support"):
        candidates(free)


def flat(openings):
    """Openings at the corners of all faces, of those at both ends of each joint."""
    return openings.reshape(len(openings), -1)


def comparison(rows):
    return Comparison(ARCH, read_observations(rows, ARCH), TRUST)


def test_a_width_that_fits_is_likelier_than_one_that_does_not():
    compared = comparison([{"joint": "voussoir 3 | voussoir 4", "width": 0.004}])
    joint = int(compared.chance[0].argmax())
    openings = np.zeros((3, len(compared.joints.block_a), 2))
    openings[:, joint, 1] = [0.0, 0.004, 0.006]
    found = compared.log_likelihood(compared.widths(flat(openings)), np.zeros((3, 0, 2)))
    assert found[1] > found[2] > found[0]
    # No observation weighs more than its chance of having another cause.
    assert found[1] - found[0] < np.log(1.0 / TRUST.outliers) + 3.0


def test_a_crack_in_the_next_joint_counts_where_only_its_place_is_known():
    x, y = 0.0, 1.0
    rows = {"x": x, "y": y, "width": 0.004}, {"joint": "voussoir 3 | voussoir 4", "width": 0.004}
    placed, named = (Comparison(ARCH, read_observations([row], ARCH), Trust(0.25, 0.4, 0.05)) for row in rows)
    for compared in (placed, named):
        np.testing.assert_allclose(compared.chance.sum(axis=1), 1.0)
    own = int(named.own[0])
    assert placed.own[0] == own
    assert placed.chance[0, own] < named.chance[0, own] == 1.0
    # The crack itself, in the next joint, or nowhere.
    other = int(np.argsort(placed.chance[0])[-2])
    openings = np.zeros((3, len(placed.joints.block_a), 2))
    openings[0, own], openings[1, other] = 0.004, 0.004
    beside = []
    for compared in (placed, named):
        found = compared.log_likelihood(compared.widths(flat(openings)), np.zeros((3, 0, 2)))
        assert found[0] > found[2] + 2.0
        beside.append(found[1] - found[2])
    assert beside[0] > 1.5
    assert beside[1] == 0.0, "a joint that is named is no other"
    pairs = placed.likeliest(placed.widths(flat(openings)))[:2, 0]
    assert placed.joint[pairs].tolist() == [own, other]


def test_on_which_side_a_joint_gapes_counts_where_it_was_measured():
    inner, outer = 0.93, 1.07
    compared = comparison([{"x": 0.0, "y": inner, "width": 0.004}, {"x": 0.0, "y": outer, "width": 0.0}])
    joint = int(compared.own[0])
    assert joint == compared.own[1]
    lower = int(np.argmin(compared.joints.ends[joint, :, 1]))
    openings = np.zeros((2, len(compared.joints.block_a), 2))
    openings[0, joint, lower] = openings[1, joint, 1 - lower] = 0.004
    found = compared.log_likelihood(compared.widths(flat(openings)), np.zeros((2, 0, 2)))
    assert found[0] > found[1] + 3.0


def test_displacements_follow_the_rotation_of_a_block():
    compared = comparison([{"block": "voussoir 3", "x": -0.2, "y": 1.0, "dx": 0.0, "dy": -0.01}])
    moved = np.zeros((1, ARCH.n_blocks, 3))
    moved[0, ARCH.index("voussoir 3")] = [0.0, 0.0, 0.3]
    arm = np.array([-0.2, 1.0]) - ARCH.centroids[ARCH.index("voussoir 3")]
    turned = [np.cos(0.3) * arm[0] - np.sin(0.3) * arm[1], np.sin(0.3) * arm[0] + np.cos(0.3) * arm[1]]
    np.testing.assert_allclose(compared.displacements(moved)[0, 0], np.array(turned) - arm)


def test_a_wide_crack_is_not_seen_in_every_joint_beside_it():
    """Else the model's cracks count several times, and amounts come out too small."""
    outlines = [[(k, 0.0), (k + 1.0, 0.0), (k + 1.0, 1.0), (k, 1.0)] for k in range(6)]
    names = [f"stone {k}" for k in range(6)]
    row = solver.Assembly.from_outlines(outlines, names=names, roles=["fixed", *["free"] * 4, "fixed"])
    rows = [{"x": x, "y": 0.5, "width": w} for x, w in ((1.0, 0.0), (2.0, 0.0), (3.0, 0.006), (4.0, 0.0), (5.0, 0.0))]
    compared = Comparison(row, read_observations(rows, row), Trust(0.25, 0.5, 0.05))
    amounts = np.linspace(0.5, 1.5, 101)
    openings = np.zeros((len(amounts), len(compared.joints.block_a), 2))
    openings[:, compared.own[2]] = 0.006 * amounts[:, None]
    found = compared.log_likelihood(compared.widths(flat(openings)), np.zeros((len(amounts), 0, 2)))
    assert amounts[found.argmax()] == pytest.approx(1.0, abs=0.011)


def test_a_joint_that_was_seen_closed_and_opens_is_unexplained():
    rows = [{"joint": f"voussoir {k} | voussoir {k + 1}", "width": w} for k, w in ((2, 0.0), (3, 0.004), (4, 0.0))]
    compared = comparison(rows)
    openings = np.zeros((1, len(compared.joints.block_a), 2))
    openings[0, compared.own[:2]] = 0.004
    widths = compared.widths(flat(openings))
    best = SimpleNamespace(widths=widths, displacements=np.zeros((1, 0, 2)), log_likelihood=np.zeros(1))
    by_best, by_none, *_ = ranking.unexplained(compared, [SimpleNamespace(best=best, at=0)], [best])
    assert by_best.tolist() == [True, False, False]
    assert not by_none.any()


def test_a_crack_of_the_usual_width_that_is_not_made_is_unexplained():
    """None at all is within three standard deviations of it, which are those of the model for the most part."""
    rows = [{"joint": f"voussoir {k} | voussoir {k + 1}", "width": 0.004} for k in (2, 3)]
    compared = comparison(rows)
    openings = np.zeros((1, len(compared.joints.block_a), 2))
    openings[0, compared.own[0]] = 0.004
    widths = compared.widths(flat(openings))
    best = SimpleNamespace(widths=widths, displacements=np.zeros((1, 0, 2)), log_likelihood=np.zeros(1))
    assert (np.abs(compared.misfits(widths, best.displacements)[0]) < 3.0).all()
    by_best, *_ = ranking.unexplained(compared, [SimpleNamespace(best=best, at=0)], [best])
    assert by_best.tolist() == [False, True]


def test_what_was_measured_is_a_stray_no_likelier_where_more_is_looked_at():
    found = []
    for farthest in (0.03, 0.3):
        observed = read_observations([{"block": "right springer", "dx": 0.02, "dy": 0.0}], ARCH)
        compared = Comparison(ARCH, observed, TRUST, farthest)
        amounts = np.linspace(0.0, farthest, 30001)
        moved = np.stack([amounts, np.zeros_like(amounts)], axis=1)[:, None]
        likelihood = np.exp(compared.log_likelihood(np.zeros((len(amounts), 0)), moved))
        near = np.abs(amounts - 0.02) < 0.004
        found.append(likelihood[near].sum() / likelihood.sum())
    assert found == pytest.approx([0.975, 0.975], abs=0.01)


def test_supports_that_have_all_moved_are_measured_against_each_other():
    rows = [{"block": f"{side} springer", "dx": dx, "dy": 0.0} for side, dx in (("left", -0.01), ("right", 0.01))]
    compared, still = comparison(rows), comparison([rows[1], {**rows[0], "dx": 0.0}])
    moved = np.array([[[0.0, 0.0], [0.02, 0.0]]])
    np.testing.assert_allclose(compared.in_frame(moved), [[[-0.01, 0.0], [0.01, 0.0]]], atol=1e-15)
    assert compared.made(np.zeros((1, 0)), compared.in_frame(moved)).all()
    assert not compared.made(np.zeros((1, 0)), compared.in_frame(0.0 * moved)).any()
    np.testing.assert_array_equal(still.in_frame(moved), moved)


def test_a_survey_that_moves_all_supports_alike_is_refused(tmp_path):
    case = structures.case_from('[geometry]\nlayout = "arch"\n[settlement]\ndirection = [0, -1]\n')
    rows = [{"block": f"{side} springer", "dx": 0.02, "dy": 0.0} for side in ("left", "right")]
    with pytest.raises(ValueError, match=r"has moved, all by about \(20, 0\) mm, and what all have in common opens no"):
        blockvis.explain(case, rows)


def test_the_model_has_no_part_in_how_a_support_has_moved():
    compared = comparison(
        [{"block": "left springer", "dx": 0.0, "dy": -0.01}, {"block": "voussoir 3", "dx": 0, "dy": -0.01}]
    )
    _, spread = compared.deviations
    np.testing.assert_allclose(spread[0], 0.001)
    assert (spread[1] > 0.0015).all()


def test_runs_go_as_far_as_what_was_seen_asks_for():
    cracks = read_observations([{"joint": "voussoir 3 | voussoir 4", "width": 0.003}], ARCH)
    assert reach_of(cracks, None) == pytest.approx((FARTHEST / 256, ENOUGH / 256))
    assert reach_of(cracks, 0.05)[0] == 0.05
    points = read_observations([{"block": "voussoir 3", "dx": 0.0, "dy": -0.003}], ARCH)
    assert reach_of(points, None) == (AS_FAR / 256, np.inf)


def test_stones_lean_to_a_side():
    text = '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [0, -1]\n'
    case = structures.case_from(text)
    _, (one, *_) = candidates(ARCH)
    orders = {lean: ordered(case, ARCH, one.motions, Variant(0.6, lean), (0.02, 0.01)) for lean in (-1, 0, 1)}
    ratio = orders[1].given.loads.dead[:, 1] / orders[0].given.loads.dead[:, 1]
    x = ARCH.centroids[:, 0]
    assert ratio[x.argmax()] == pytest.approx(1.0 + LEANING)
    assert ratio[x.argmin()] == pytest.approx(1.0 - LEANING)
    np.testing.assert_allclose(orders[-1].given.loads.dead[:, 1] / orders[0].given.loads.dead[:, 1], 2.0 - ratio)


def runs_of(folder, name, arch):
    """An explanation of a crack in an arch, whose left springer has moved to the left."""
    blockvis.save_layout(arch, folder / f"{name}.json")
    (folder / f"{name}.toml").write_text(
        f"[geometry]\nfile = '{name}.json'\n[material]\nfriction_coefficient = 0.6\n"
        "[explain]\nsupports = ['left springer']\ndirections = ['left']\nfriction = [0.6, 0.6]\n",
        encoding="utf-8",
    )
    return blockvis.explain(folder / f"{name}.toml", [{"joint": "voussoir 3 | voussoir 4", "width": 0.003}])


@pytest.mark.thorough
def test_runs_are_known_at_all_amounts_up_to_where_joints_are_wide_open(tmp_path):
    found = runs_of(tmp_path, "near", ARCH)
    assert found.runs
    for run in found.runs.values():
        openings = found.comparison.openings(run.moved).max(axis=1)
        assert openings[:-1].max() <= ENOUGH / 256 < openings[-1]
        # Between two steps the pose is interpolated; each is twice as long as the one before, at most.
        assert (np.diff(run.amounts)[1:] <= 2.001 * np.diff(run.amounts)[:-1]).all()
        assert run.amounts[1] < 1e-3 * run.amounts[-1]
        assert not run.fell


@pytest.mark.thorough
def test_runs_on_a_national_grid_are_those_near_the_origin(tmp_path):
    far = replace(ARCH, shapes=ARCH.shapes.shifted(np.array([4e5, 5e6])))
    near, far = (list(runs_of(tmp_path, *given).runs.values()) for given in (("near", ARCH), ("far", far)))
    assert len(near) == len(far) > 0
    for one, other in zip(near, far, strict=True):
        np.testing.assert_allclose(one.amounts, other.amounts, rtol=1e-3)
        np.testing.assert_allclose(one.moved, other.moved, atol=1e-3 * np.abs(one.moved).max())


@pytest.mark.slow
def test_an_interrupt_does_not_wait_for_runs():
    futures = []

    def interrupted():
        with workers_for(8, 2, None) as processes:
            futures.append(processes.submit(time.sleep, 0.01))
            futures.extend(processes.submit(time.sleep, 300.0) for _ in range(4))
            futures[0].result()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    # One that was waited for would have its result.
    with pytest.raises((CancelledError, BrokenExecutor)):
        futures[-1].result(timeout=100.0)


def test_the_amount_of_a_trough_is_how_far_it_lowers_one_foot_below_another():
    wall = generators.wall(bricks=4, courses=2, brick_length=0.5, settling=[0.0, 2.0])
    ground, found = candidates(wall)
    narrow = next(one for one in found if one.detail.startswith("deepest at x = 1 m, steepest 0.333 m"))
    wide = trough(ground, 1.0, 4.0)
    turned = next(one for one in candidates(ARCH)[1] if one.turns)
    # A foot goes by the mean of its ends.
    assert 0.7 < per_amount(ground.assembly, narrow)[0] < 0.85
    assert 0.0 < per_amount(ground.assembly, wide)[0] < 0.03
    assert per_amount(ARCH, turned)[1] == "rad"


def trial(cause, evidence, *, shared=None, prior=1.0, detail="", refines=""):
    candidate = SimpleNamespace(cause=cause, prior=prior, detail=detail, refines=refines)
    log = np.full(10, evidence, dtype=float)
    return SimpleNamespace(
        candidate=candidate, shared=shared or candidate, variant=SimpleNamespace(friction=0.6), unit="m",
        amounts=np.geomspace(1e-3, 1e-2, 10),
        log_likelihood=log, log_mass=log, log_evidence=evidence, best=0,
    )  # fmt: skip


def test_probabilities_are_those_of_bayes():
    causes = ranking.ranked([trial("a", 0.0), trial("b", np.log(0.25)), trial("c", -np.inf)], apart=False)
    assert [(c.name, round(c.probability, 6)) for c in causes] == [("a", 0.8), ("b", 0.2)]
    half = ranking.ranked([trial("a", 0.0, prior=0.5), trial("b", 0.0)], apart=False)
    assert [(c.name, round(c.probability, 6)) for c in half] == [("b", 0.666667), ("a", 0.333333)]


def test_what_a_cause_leaves_open_is_averaged_and_refinements_share_a_weight():
    coarse = [trial("trough", 0.0, detail="x"), trial("trough", -np.inf, detail="y"), trial("other", 0.0)]
    assert ranking.ranked(coarse, apart=False)[0].name == "other"
    assert ranking.ranked(coarse, apart=False)[0].probability == pytest.approx(2.0 / 3.0)
    finer = [*coarse, trial("trough", 0.0, detail="x2", refines="x")]
    assert ranking.ranked(finer, apart=False)[0].probability == pytest.approx(2.0 / 3.0)


def test_twins_are_one_cause_for_cracks_and_two_for_displaced_points():
    one = trial("left moves left", 0.0)
    other = trial("right moves right", 0.0, shared=one.candidate)
    (cause,) = ranking.ranked([one, other], apart=False)
    assert (cause.name, cause.also) == ("left moves left", ("right moves right",))
    assert len(ranking.ranked([one, other], apart=True)) == 2


def causes_opening(compared, *openings):
    """Causes of given evidence that open some joints of the arch by given widths [m]."""
    trials = []
    for number, (evidence, widths) in enumerate(openings):
        gaps = np.zeros((1, len(compared.joints.block_a), 2))
        for joint, width in widths.items():
            gaps[:, joint] = width
        one = trial(f"cause {number}", evidence)
        one.openings = lambda amounts, gaps=gaps: np.repeat(flat(gaps), len(amounts), axis=0)
        trials.append(one)
    return ranking.ranked(trials, apart=False)


def test_a_measurement_is_to_part_the_causes_that_cannot_be_told_apart():
    compared = comparison([{"joint": "voussoir 3 | voussoir 4", "width": 0.004}])
    measured = int(compared.own[0])
    first, second = [joint for joint in range(len(compared.joints.block_a)) if joint != measured][:2]
    unlikely = (np.log(0.04), {first: 0.05})
    causes = causes_opening(compared, (0.0, {}), (np.log(0.3), {second: 0.003, measured: 0.05}), unlikely)
    found = ranking.next_measurement(compared, causes)
    assert (found.joint, [name for name, _ in found.widths]) == (second, ["cause 0", "cause 1"])
    # What parts the first from another that is much less probable does not help.
    alike = causes_opening(compared, (0.0, {}), (np.log(0.3), {measured: 0.05}), unlikely)
    assert ranking.next_measurement(compared, alike) is None
    # Where the first is told apart, it is to be confirmed against the next.
    assert ranking.next_measurement(compared, causes_opening(compared, (0.0, {}), unlikely)).joint == first


TIED = '[[ties]]\nname = "iron"\nfrom = [-0.9, 0.3]\nto = [0.9, 0.3]\nstiffness = 1e7\n'


def test_runs_of_causes_have_the_ties_of_the_case(tmp_path):
    layout = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 6 }\n'
    case = structures.case_from(layout + TIED + "[settlement]\ndirection = [0, -1]\n")
    _, (one, *_) = candidates(ARCH)
    assert [tie.name for tie in ordered(case, ARCH, one.motions, Variant(0.6, 0), (0.02, 0.01)).given.ties] == ["iron"]
    grounded = TIED.replace("[0.9, 0.3]", "{ fixed = [2.0, 0.0] }")
    (tmp_path / "case.toml").write_text(layout + grounded, encoding="utf-8")
    (tmp_path / "cracks.csv").write_text("kind,block_a,block_b,width\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"case.toml: \[ties\] 'iron' is held by the ground"):
        blockvis.explain(tmp_path / "case.toml", tmp_path / "cracks.csv")


STRONG = "cohesion = 1e6\ntensile_strength = 1e6\n"
SOFT = "normal_stiffness = 1e8\nshear_stiffness = 1e8\n"


@pytest.mark.slow
def test_cracks_of_causes_are_those_of_joints_with_mortar_or_that_give():
    layout = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 6 }\n[material]\nfriction_coefficient = 0.6\n'
    _, (one, *_) = candidates(ARCH)
    widest = {}
    for name, law in {"dry": "", "glued": STRONG, "soft": SOFT}.items():
        case = structures.case_from(layout + law + "[settlement]\ndirection = [0, -1]\n")
        order = ordered(case, ARCH, one.motions, Variant(0.6, 0), (0.02, np.inf))
        given = order.given
        short = order.settlement.limit / 45.0
        first = replace(order.settlement, increment=short, limit=short)
        response = solver.settle(given.assembly, first, interfaces=given.interfaces, loads=given.loads)
        widest[name] = np.asarray(structures.posed(ARCH, response.path[-1].pose).joints(0).cell_data["opening"]).max()
    assert widest["soft"] < 0.5 * widest["dry"]
    assert 0.2 * widest["dry"] < widest["glued"] < 0.8 * widest["dry"]


def test_more_friction_takes_the_tension_that_the_joints_then_cannot_have():
    law = "friction_coefficient = 0.6\ncohesion = 1e4\ntensile_strength = 1.5e4\n"
    case = structures.case_from(
        f'[geometry]\nlayout = "arch"\nparameters = {{ voussoirs = 6 }}\n[material]\n{law}'
        f'[[interfaces]]\nmaterials = ["a", "b"]\n{law}[settlement]\ndirection = [0, -1]\n'
    )
    _, (one, *_) = candidates(ARCH)
    given = ordered(case, ARCH, one.motions, Variant(0.75, 0), (0.02, 0.01)).given
    for law in given.interfaces.laws:
        assert (law.friction_coefficient, law.tensile_strength) == pytest.approx((0.75, 1e4 / 0.75))


def test_increments_without_steps_are_refused(tmp_path):
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[analysis]\nincrements = "linear program"\n', encoding="utf-8"
    )
    with pytest.raises(ValueError, match=r'increments is "linear program", which has no steps .*; leave it out'):
        blockvis.explain(tmp_path / "case.toml", [{"joint": "voussoir 3 | voussoir 4", "width": 0.003}])


def test_supports_that_all_move_as_one_are_refused_before_anything_is_followed(tmp_path):
    settings = '[explain]\nsupports = [["left springer", "right springer"]]\ndirections = ["down", "left"]\n'
    layout = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 6 }\n'
    (tmp_path / "case.toml").write_text(layout + settings, encoding="utf-8")
    with pytest.raises(ValueError, match=r"case.toml: \[explain\] supports moves all .* as one, which opens no crack"):
        blockvis.explain(tmp_path / "case.toml", [{"joint": "voussoir 3 | voussoir 4", "width": 0.003}])


SETTLED = '[[settlement]]\nblocks = "right springer"\ndirection = [0, -1]\nlimit = 0.01\n'


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[[remove]]\nphase = 1\nblocks = "voussoir 3"\n', r"\[remove\] takes away what blockvis explain would follow"),
        # A tie that came between two settlements has no place in one movement, and neither has a load.
        (
            f"{2 * SETTLED}{TIED}phase = 2\n",
            r"\[ties\] 'iron': phase is 2, and blockvis explain follows one movement",
        ),
        (
            2 * SETTLED + '[[loads]]\nblocks = "voussoir 3"\nforce = [0, -300]\nphase = 2\n',
            r"\[loads 1\] phase is 2, and blockvis explain has no settlement",
        ),
        (
            "[material]\nfriction_coefficient = 0.6\ncompressive_strength = 1e6\n",
            r"crushing along the path .* leave compressive_strength out",
        ),
    ],
)
def test_cases_that_have_no_causes_are_refused(tmp_path, more, words):
    case = f'[geometry]\nlayout = "arch"\nparameters = {{ voussoirs = 6 }}\n{more}'
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    (tmp_path / "cracks.csv").write_text("kind,block_a,block_b,width\n", encoding="utf-8")
    with pytest.raises(ValueError, match=f"case.toml.*{words}"):
        blockvis.explain(tmp_path / "case.toml", tmp_path / "cracks.csv")
