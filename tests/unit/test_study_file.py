"""The study file: what it makes of a case, and what it refuses before anything starts."""

import re
from pathlib import Path

import numpy as np
import pytest

from blockvis.case_files.read import case_of
from blockvis.cases.value_paths import parse_path, put
from blockvis.cli import main
from blockvis.studies import campaign
from blockvis.studies.sampling import METHODS, designed
from blockvis.studies.study_file import read_study

CASE = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 8
[material]
friction_coefficient = 0.6
[roles]
"right springer" = "moving"
[[settlement]]
direction = [1, 0]
increment = 0.02
limit = 0.3
[output]
animation = false
"""

STUDY = """
[study]
case = "case.toml"
method = "latin hypercube"
runs = 8
seed = 3
[parameters]
"material.friction_coefficient" = { name = "friction", distribution = "uniform", lower = 0.4, upper = 0.8 }
"""


@pytest.fixture
def study_file(tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def _with(study_file, old, new):
    text = study_file.read_text(encoding="utf-8")
    assert old in text
    study_file.write_text(text.replace(old, new), encoding="utf-8")
    return study_file


def test_paths_lead_into_tables_lists_and_quoted_names():
    values = {"supports": [{"outline": [[0, 0], [1, 0]]}], "settlement": {"direction": [1, 0]}}
    put(values, parse_path("supports[0].outline[1][0]"), 2.5)
    put(values, parse_path('roles."right springer"'), "moving")
    put(values, parse_path("settlement[0].direction"), [0, -1])
    assert values["supports"][0]["outline"] == [[0, 0], [2.5, 0]]
    assert values["roles"] == {"right springer": "moving"}
    assert values["settlement"] == {"direction": [0, -1]}


@pytest.mark.parametrize("path", ["", ".a", "a..b", "a b", "[0]", "a.[0]", 'a"b"', "a[x]"])
def test_what_is_no_path(path):
    with pytest.raises(ValueError, match=r"path into a case file"):
        parse_path(path)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("supports[1].name", "supports has 1 entries"),
        ("supports.name", r"supports is a list of 1; say which entry, for instance supports\[0\].name"),
        ("support[0].name", "no list 'support' (did you mean 'supports'?)"),
        ("unit.length", "unit is 'm', no table"),
    ],
)
def test_paths_that_lead_nowhere(path, words):
    with pytest.raises(ValueError, match=words if "\\" in words else re.escape(words)):
        put({"supports": [{"name": "a"}], "unit": "m"}, parse_path(path), 1)


def test_every_run_is_a_case_with_its_values_and_its_seed(study_file):
    _with(study_file, "[parameters]\n", '[parameters]\n"geometry.parameters.voussoirs" = [8, 9]\n')
    with open(study_file, "a", encoding="utf-8") as file:
        file.write('[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
    study = read_study(study_file)
    cases = [case_of(study.values_of(run), study.case_source) for run in range(study.n_runs)]
    assert sorted({c.parameters["voussoirs"] for c in cases}) == [8, 9]
    assert [c.friction_coefficient for c in cases] == [study.point(run)["friction"] for run in range(8)]
    seeds = [c.imperfections[0].seed for c in cases]
    assert len(set(seeds)) == 8
    again = read_study(study_file)
    assert [again.order(run) for run in range(8)] == [study.order(run) for run in range(8)], "all from the seed"
    _with(study_file, "seed = 3", "seed = 4")
    assert read_study(study_file).order(0) != study.order(0)


def test_imperfections_of_the_case_keep_their_seed(study_file, tmp_path):
    (tmp_path / "case.toml").write_text(
        CASE + '[[imperfections]]\nkind = "density"\ndistribution = "lognormal"\ndeviation = 0.1\nseed = 77\n',
        encoding="utf-8",
    )
    with open(study_file, "a", encoding="utf-8") as file:
        file.write('[[imperfections]]\nkind = "friction"\ndistribution = "lognormal"\ndeviation = 0.1\n')
    study = read_study(study_file)
    found = [case_of(study.values_of(run), study.case_source).imperfections for run in (0, 1)]
    assert [one.kind for one in found[0]] == ["friction", "density"]
    assert found[0][1].seed == found[1][1].seed == 77
    assert found[0][0].seed != found[1][0].seed


def test_a_parameter_may_be_a_number_of_an_imperfection(study_file):
    _with(study_file, "[parameters]\n", '[parameters]\n"imperfections[0].deviation" = [0.001, 0.004]\n')
    with open(study_file, "a", encoding="utf-8") as file:
        file.write('[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
    study = read_study(study_file)
    found = {
        case_of(study.values_of(r), study.case_source).imperfections[0].distribution.numbers["deviation"]
        for r in range(8)
    }
    assert found == {0.001, 0.004}


def test_latin_hypercube_has_one_run_in_every_stratum():
    design = designed("latin hypercube", 50, [0, 0, 0], 1, 5, scattered=True)
    for column in design.probabilities.T:
        assert sorted(np.floor(50 * column).astype(int).tolist()) == list(range(50))
    assert len(set(design.seeds.tolist())) == 50


def test_sobol_sequence_is_balanced():
    design = designed("sobol", 64, [0, 0], 1, 5, scattered=False)
    cells = np.floor(8 * design.probabilities).astype(int)
    assert len({tuple(c) for c in cells.tolist()}) == 64, "one point in each of 8 × 8 cells"


def test_grid_takes_every_combination_and_repeats_with_other_seeds(study_file):
    _with(study_file, 'method = "latin hypercube"\nruns = 8\n', 'method = "grid"\nrepeats = 2\n')
    _with(study_file, "upper = 0.8 }", 'upper = 0.8, points = 4 }\n"geometry.parameters.voussoirs" = [8, 9, 10]')
    with open(study_file, "a", encoding="utf-8") as file:
        file.write('[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
    study = read_study(study_file)
    points = [tuple(study.point(run).values()) for run in range(study.n_runs)]
    assert len(points) == 24
    assert len(set(points)) == 12
    assert sorted({p[0] for p in points}) == pytest.approx([0.45, 0.55, 0.65, 0.75])
    assert len({study.order(run)["seed"] for run in range(24)}) == 24


def test_saltelli_rows_exchange_one_factor_each():
    design = designed("saltelli", 4, [0, 0], 1, 5, scattered=True)
    assert design.factors == 3
    assert len(design.seeds) == 4 * 5
    u, seeds = design.probabilities.reshape(4, 5, 2), design.seeds.reshape(4, 5)
    a, b = u[:, 0], u[:, 4]
    np.testing.assert_array_equal(u[:, 1], np.column_stack([b[:, 0], a[:, 1]]))
    np.testing.assert_array_equal(u[:, 2], np.column_stack([a[:, 0], b[:, 1]]))
    np.testing.assert_array_equal(u[:, 3], a)
    assert (seeds[:, :3] == seeds[:, :1]).all()
    assert (seeds[:, 3] == seeds[:, 4]).all()
    assert (seeds[:, 0] != seeds[:, 4]).all()
    assert design.independent.sum() == 8


def test_every_method_is_known(study_file):
    for method in METHODS:
        assert len(designed(method, 4, [2], 1, 0, scattered=False).seeds) >= 2


BAD = [
    ("material.friction_coefficient", "material.friction_coeficient", ("did you mean 'friction_coefficient'",)),
    ("material.friction_coefficient", "materiel.friction", ("materiel", "did you mean 'material'")),
    ("material.friction_coefficient", "geometry.parameters.voussoir", ("voussoir", "did you mean 'voussoirs'")),
    ("material.friction_coefficient", "settlement[1].limit", ("settlement has 1 entries",)),
    ("material.friction_coefficient", "material friction", ("is not a path",)),
    ("lower = 0.4", "lower = 0.9", ("lower is 0.9 and upper is 0.8",)),
    ('"uniform"', '"unifrom"', ("did you mean 'uniform'",)),
    ("lower = 0.4", "lower = -0.2", ("run ", "is no case", "friction_coefficient is -", "at least 0")),
    ('"latin hypercube"', '"latin cube"', ("did you mean 'latin hypercube'",)),
    ("runs = 8", "runs = 0", ("runs is 0", "at least 1")),
    ("runs = 8", "rums = 8", ("did you mean 'runs'",)),
    ('"case.toml"', '"cave.toml"', ("there is no case file", "case.toml")),
    ('name = "friction"', 'name = "status"', ("column of the table already",)),
    ('method = "latin hypercube"\nruns = 8', 'method = "grid"', ("a grid needs points",)),
    ("seed = 3", "seed = 3\nkeep = [9]", ("keep names run 9", "0 to 7")),
    ("[study]", "[studie]", ("did you mean 'study'",)),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD, ids=[b[1][:24] for b in BAD])
def test_bad_input_is_one_message_and_nothing_started(study_file, capsys, old, new, words):
    _with(study_file, old, new)
    out = study_file.parent / "out"
    assert main(["sweep", str(study_file), "-o", str(out)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1, message
    for word in ("study.toml", *words):
        assert word in message
    assert not out.exists()


def test_sobol_needs_a_power_of_two(study_file):
    _with(study_file, '"latin hypercube"\nruns = 8', '"sobol"\nruns = 12')
    with pytest.raises(ValueError, match=r"runs is 12; .* give 8 or 16"):
        read_study(study_file)


def test_nothing_varied_is_refused(tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    with pytest.raises(ValueError, match="nothing is varied"):
        read_study({"study": {"case": str(tmp_path / "case.toml")}})


def test_an_unreachable_scheduler_is_one_message_and_nothing_started(study_file, capsys, monkeypatch):
    monkeypatch.setattr(campaign, "ANSWER", 0.5)
    out = study_file.parent / "out"
    assert main(["sweep", str(study_file), "-o", str(out), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    message = capsys.readouterr().err
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in message
    assert "dask scheduler" in message
    assert not out.exists()


@pytest.mark.parametrize(("name", "runs"), [("arch_friction", 256), ("panel_settlement_friction", 36)])
def test_shipped_studies_are_studies(name, runs):
    study = read_study(Path(__file__).parents[2] / "examples" / "studies" / f"{name}.toml")
    assert study.n_runs == runs
