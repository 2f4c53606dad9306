"""A name in a case stands for every block that is drawn with it."""

import numpy as np
import pytest
from structures import drawn, rectangle

import blockvis
import solver

NAMES = ["pier", "mid", "pier", "beam", "cap", "cap"]
BLOCKS = [
    *(rectangle(x, -0.3, x + 0.4, 0.0) for x in (0.0, 0.8, 1.6)),
    rectangle(0.0, 0.0, 2.0, 0.3),
    *(rectangle(x, 0.3, x + 0.4, 0.6) for x in (0.2, 1.2)),
]
STEP = "[[settlement]]\nincrement = 0.001\nlimit = 0.001\n"
SETTLES = f"{STEP}direction = [0, -1]\n"
PUSHED = '[[loads]]\nkind = "live"\nforce = [1, 0]\nblocks = "beam"\n[analysis]\nkind = "pushover"\n'


@pytest.fixture
def response(tmp_path):
    """A function that runs a beam on three piers, under two stones; two names are there twice."""
    role = ["moving"] * 3 + ["free"] * 3

    def run(text, names=NAMES, **told):
        drawn(tmp_path / "names.json", BLOCKS, names, role=role, **told)
        (tmp_path / "case.toml").write_text(f'[geometry]\nfile = "names.json"\n{text}', encoding="utf-8")
        return blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", overwrite=True, outputs=()).response

    return run


@pytest.mark.parametrize(
    "motion",
    [
        'direction = [0, -1]\nblocks = ["pier"]',
        pytest.param("profile = {supports = {pier = [0, -1]}}", marks=pytest.mark.thorough),
    ],
)
def test_a_settlement_moves_all_supports_with_its_name(response, motion):
    found = response(f"{STEP}{motion}")
    gone = found.path[-1].pose.positions - found.assembly.centroids
    np.testing.assert_allclose(gone[:3], [[0.0, -0.001], [0.0, 0.0], [0.0, -0.001]], atol=1e-12)


def test_pieces_of_all_supports_with_a_name_settle(response):
    """Of two, of which the profile cuts the first into pieces."""
    under = "".join(
        f'[[supports]]\nname = "ground"\nrole = "moving"\noutline = [[{a}, -1], [{b}, -1], [{b}, -0.3], [{a}, -0.3]]\n'
        for a, b in ((0.0, 1.2), (1.6, 2.0))
    )
    profile = 'blocks = ["ground"]\nprofile = {kind = "gaussian", centre = 1.0, inflection = 0.3}\n'
    named = r"\[supports\] name: 'ground' is the name of another support or block: .* for all 2, .*'ground #2'"
    with pytest.warns(UserWarning, match="'ground' into 3 pieces"), pytest.warns(UserWarning, match=named):
        found = response(f'{under}[roles]\npier = "free"\nmid = "free"\n{SETTLES}{profile}')
    assert found.assembly.names[-4:] == ("ground 1", "ground 2", "ground 3", "ground #2")
    assert (found.path[-1].pose.positions[-4:, 1] < found.assembly.centroids[-4:, 1]).all()


def test_loads_and_removals_are_of_all_blocks_with_their_name(response):
    with pytest.warns(UserWarning, match="acts on each of 2 blocks"):
        found = response(
            f'{SETTLES}{SETTLES}[[loads]]\nblocks = "cap"\nforce = [5, 0]\n'
            '[[loads]]\nblocks = "cap #2"\nforce = [0, 1]\n[[remove]]\nphase = 2\nblocks = ["cap"]\n'
        )
    more = found.loads.dead - solver.self_weight(found.assembly).dead
    np.testing.assert_allclose(more[3:, :2], [[0.0, 0.0], [5.0, 0.0], [5.0, 1.0]], atol=1e-9)
    assert found.path[-1].removed.tolist() == [False] * 4 + [True] * 2


@pytest.mark.thorough
def test_loads_and_removals_are_of_all_blocks_of_a_material(response):
    """Of a drawing in CAD, whose blocks have no names, that is a layer; a name that is there comes first."""
    stones = {"material": ["mid"] * 4 + ["CAPS"] * 2}
    with pytest.warns(UserWarning, match="acts on each of 2 blocks"):
        found = response(
            f'{SETTLES}{SETTLES}[[loads]]\nblocks = "CAP?"\nforce = [5, 0]\n[[remove]]\nphase = 2\nblocks = ["CAPS"]\n',
            **stones,
        )
    more = found.loads.dead - solver.self_weight(found.assembly).dead
    np.testing.assert_allclose(more[3:, 0], [0.0, 5.0, 5.0], atol=1e-9)
    assert found.path[-1].removed.tolist() == [False] * 4 + [True] * 2
    for table, where in (
        ('[[loads]]\nblocks = "CUPS"\nforce = [5, 0]', "loads 1"),
        ('[[remove]]\nphase = 1\nblocks = ["CUPS"]', "remove"),
    ):
        said = rf"\[{where}\] blocks: no block and no material is named 'CUPS' \(did you mean 'CAPS'\?\)"
        with pytest.raises(ValueError, match=f"{said}; the blocks are pier, mid.*the materials are mid, CAPS"):
            response(f"{SETTLES}{table}\n", **stones)
    with pytest.raises(ValueError, match="'mid' matches supports only"):
        response(f'{SETTLES}[[loads]]\nblocks = "mid"\nforce = [5, 0]\n', **stones)


def test_one_block_is_the_one_that_holds_the_point(response):
    found = response(
        f'{PUSHED}[control]\nblock = "cap"\npoint = [1.3, 0.6]\nincrement = 1e-3\nlimit = 1e-3\n'
        '[[ties]]\nname = "tie"\nfrom = {block = "cap", point = [1.4, 0.4]}\nto = {fixed = [3, 0.4]}\nstiffness = 1e6\n'
    )
    assert found.control.block == "cap #2"
    assert found.ties[0].blocks == (5, None)
    with pytest.raises(ValueError, match=r"\[control\] block: 2 blocks are called 'cap'; give a point of one"):
        response(f'{PUSHED}[control]\nblock = "cap"\n')


def test_fill_lies_over_all_blocks_with_its_name(response):
    found = response(f'{SETTLES}[[backfill]]\nover = ["cap"]\nsurface = 1.0\nunit_weight = 1e4\n')
    assert np.unique(found.loads.fills[0].block).tolist() == [4, 5]


def test_a_role_by_the_drawn_name_gives_way_to_that_of_one_block(tmp_path):
    """As in a layout that was written, too."""
    names = ["pier", "mid", "pier", "beam", "stone #2", "cap #2"]
    path = tmp_path / "written.json"
    blockvis.save_layout(blockvis.read(drawn(tmp_path / "drawn.json", BLOCKS, names)), path)
    read = blockvis.read(path, roles={"pier #2": "moving", "pier": "fixed"})
    assert read.roles.tolist() == ["fixed", "free", "moving", "free", "free", "free"]
    assert blockvis.read(path, roles={"pier": "fixed"}).roles.tolist() == ["fixed", "free", "fixed", *["free"] * 3]
    assert blockvis.read(path, roles={"pier #2": "fixed"}).roles.tolist() == ["free", "free", "fixed", *["free"] * 3]
    # Numbers that were drawn are part of a name.
    with pytest.raises(ValueError, match="'stone' matches no block"):
        blockvis.read(path, roles={"stone": "fixed"})


def test_a_name_that_was_drawn_with_a_number_is_that_of_one_block(response):
    """Also in the results of the run, and in the next case."""
    drawn_so = [f"{name} #2" if k == 2 else name for k, name in enumerate(NAMES)]
    found = response(f'{STEP}direction = [0, -1]\nblocks = ["pier"]', drawn_so)
    gone = found.path[-1].pose.positions - found.assembly.centroids
    np.testing.assert_allclose(gone[:3], [[0.0, -0.001], [0.0, 0.0], [0.0, 0.0]], atol=1e-12)
    assert found.assembly.names[2] == found.assembly.drawn_names[2] == "pier #2"


def test_results_keep_the_names_that_were_drawn(response, tmp_path):
    found = response(f'{SETTLES}[[remove]]\nphase = 1\nblocks = ["cap"]\n')
    again = blockvis.open_results(tmp_path / "out").assembly
    assert again.drawn_names == found.assembly.drawn_names == tuple(NAMES)
    assert again.names == found.assembly.names == ("pier", "mid", "pier #2", "beam", "cap", "cap #2")


def test_a_number_that_was_drawn_makes_no_piece_of_a_support(response):
    """Two supports drawn as "pier 1" and "pier 2" are no pieces of a "pier" that nobody has drawn."""
    with pytest.raises(ValueError, match=r"blocks: no block is named 'pier' \(did you mean 'pier \d'\?\)"):
        response(f'{STEP}direction = [0, -1]\nblocks = ["pier"]', ["pier 1", "mid", "pier 2", "beam", "cap", "cap"])
