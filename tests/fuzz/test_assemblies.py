"""A few random structures before the oracle; campaign.py tries as many as there is time for."""

import pytest
from judge import tried
from rubble import KINDS, trial

import solver

pytestmark = pytest.mark.path


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_nothing_is_contradicted(kind):
    findings = [tried(kind, seed) for seed in range(10_000, 10_004)]
    assert [(f.seed, f.wrong) for f in findings if f.wrong] == []
    assert sum(
        f.checks.get("equilibrium at the start", 0) + f.checks.get("no equilibrium at the start", 0) for f in findings
    )


@pytest.mark.thorough
def test_three_blocks_at_a_corner():
    """Here a reaction was once 6 % of the weight too small."""
    assert tried("voronoi", 1049).wrong == []


@pytest.mark.thorough
def test_a_sliver_that_tips_does_not_end_the_run():
    """Here 0.07 % of the weight once passed for the collapse of the whole."""
    finding = tried("cuts", 100320)
    assert finding.wrong == []
    assert finding.outcome == "limit reached"


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "seed"), [("arch", 100004), ("courses", 100125), ("courses", 100231)])
def test_blocks_wedged_by_rounding_are_no_failure(kind, seed):
    """Here HiGHS found programs unbounded by less than their ray proves."""
    finding = tried(kind, seed)
    assert finding.wrong == []
    assert finding.outcome in ("limit reached", "locked")


@pytest.mark.slow
def test_the_reaction_of_the_path_is_told_where_joints_that_close_carry_it_to_its_tolerance():
    """Here one of five was told as 0.249 W, with forces of 7e5 W: smooth stones that closed by 2e-4 of R too little."""
    given = trial("courses", 917326)
    response = solver.settle(given.assembly, given.settlement, friction_coefficient=given.friction)
    assert response.reaction[1:] / response.total_weight == pytest.approx(0.02907, rel=0.005)
    assert max(i.forces.max() for i in response.path[1:]) < 1e3 * response.total_weight


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.slow
def test_what_flies_away_without_drag_warns_of_nothing():
    """Here forces without the drag were looked for of a stack that falls, and numpy said that they are no numbers."""
    finding = tried("stack", 130032)
    assert finding.wrong == []
    assert finding.outcome == "collapsed"


def test_a_trial_is_made_from_its_kind_and_seed_alone():
    one, other = trial("voronoi", 7), trial("voronoi", 7)
    assert one.assembly.vertices.tobytes() == other.assembly.vertices.tobytes()
    assert (one.friction, one.settlement) == (other.friction, other.settlement)


@pytest.mark.thorough
def test_joints_without_friction_have_nothing_to_stick_by():
    """Here steps grew shorter without end, as points that carry no shear force came to stick and to slide in turns."""
    finding = tried("layout", 30024)
    assert finding.wrong == []
    assert finding.outcome == "limit reached"


@pytest.mark.slow
def test_tiny_blocks_stand_like_others():
    """Here blocks of a tenth of a millimetre fell for being cheaper out of balance than the reaction."""
    finding = tried("courses", 30098)
    assert finding.wrong == []
    assert finding.outcome == "limit reached"


@pytest.mark.thorough
def test_a_way_that_turns_back_beyond_its_step_is_followed():
    finding = tried("voronoi", 30152)
    assert finding.wrong == []
    assert finding.outcome == "limit reached"


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("cuts", 30139),  # Steps of 1e-9 block sizes had more than one solution.
        ("stack", 60039),  # A bound of the reaction was found by no program.
        ("courses", 60178),  # Without friction, forces in balance through what rounding left of level joints.
        ("voronoi", 60176),  # Blocks wedged from the start beside light ones.
        ("voronoi", 50008),  # A place that a long step did not hold counted as a bound of the short ones after it.
        ("voronoi", 51086),  # What falls past an equilibrium was told to have none.
        ("arch", 51065),  # Where the supports lock was not told.
        ("cuts", 500019),  # Programs of steps were given up where their first iterations are short.
    ],
)
@pytest.mark.slow
def test_no_equilibrium_is_left_undecided(kind, seed):
    finding = tried(kind, seed)
    assert finding.wrong == []
    assert finding.outcome in ("limit reached", "collapsed", "locked")


def test_what_falls_beside_wedged_blocks_is_seen():
    """Here the forces of wedged blocks, which have no limit, passed for an equilibrium of all."""
    finding = tried("cuts", 60375)
    assert finding.wrong == []
    assert finding.outcome == "no initial equilibrium"
