"""Studies: what their file may hold, and the numbers that sum up their runs."""

import json
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.stats as st
from PIL import Image

from blockvis.case_files.read import case_of
from blockvis.cases.value_paths import parse_path, put
from blockvis.cli import main
from blockvis.studies import campaign, pictures
from blockvis.studies.fragility import fragility, fragility_of, wilson
from blockvis.studies.sampling import METHODS, designed
from blockvis.studies.sensitivity import IMPERFECTIONS, first_order, swings
from blockvis.studies.study_file import read_study
from blockvis.studies.summary import in_words, is_sample, is_single, summary_of
from solver import mechanics

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


def _added(file, text):
    """What is given stands below in the file."""
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")


def _refused(study_file, capsys, *options):
    """The message of a study of which nothing is started."""
    out = study_file.parent / "out"
    assert main(["sweep", str(study_file), "-o", str(out), *options]) == 2
    assert not out.exists()
    return capsys.readouterr().err


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
        ("supports[1].name", "supports has 1 entry"),
        ("supports.name", r"supports is a list of 1; say which entry, for instance supports\[0\].name"),
        ("supports.0.name", r"say which entry, for instance supports\[0\]$"),
        ("support[0].name", "no list 'support' (did you mean 'supports'?)"),
        ("unit.length", "unit is 'm', no table"),
    ],
)
def test_paths_that_lead_nowhere(path, words):
    with pytest.raises(ValueError, match=words if "\\" in words else re.escape(words)):
        put({"supports": [{"name": "a"}], "unit": "m"}, parse_path(path), 1)


def test_every_run_is_a_case_with_its_values_and_its_seed(study_file):
    _with(study_file, "[parameters]\n", '[parameters]\n"geometry.parameters.voussoirs" = [8, 9]\n')
    _added(study_file, '[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
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
    _added(study_file, '[[imperfections]]\nkind = "friction"\ndistribution = "lognormal"\ndeviation = 0.1\n')
    study = read_study(study_file)
    found = [case_of(study.values_of(run), study.case_source).imperfections for run in (0, 1)]
    assert [one.kind for one in found[0]] == ["density", "friction"]
    assert found[0][0].seed == found[1][0].seed == 77
    assert found[0][1].seed != found[1][1].seed
    # A path counts those of the case.
    _with(study_file, "[parameters]\n", '[parameters]\n"imperfections[0].deviation" = [0.2, 0.3]\n')
    study = read_study(study_file)
    for run in range(8):
        density, friction = case_of(study.values_of(run), study.case_source).imperfections
        assert density.distribution.numbers["deviation"] in (0.2, 0.3)
        assert friction.distribution.numbers["deviation"] == 0.1


def test_a_case_with_one_table_of_imperfections_is_studied(study_file, tmp_path):
    _added(
        tmp_path / "case.toml",
        '[imperfections]\nkind = "density"\ndistribution = "lognormal"\ndeviation = 0.1\nseed = 77\n',
    )
    study = read_study(study_file)
    assert [case_of(study.values_of(run), study.case_source).imperfections[0].seed for run in (0, 1)] == [77, 77]


def test_a_parameter_may_be_a_number_of_an_imperfection(study_file):
    _with(study_file, "[parameters]\n", '[parameters]\n"imperfections[0].deviation" = [0.001, 0.004]\n')
    _added(study_file, '[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
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
    _added(study_file, '[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\ndeviation = 0.002\n')
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
    ("material.friction_coefficient", "settlement[1].limit", ("settlement has 1 entry",)),
    ("material.friction_coefficient", "material friction", ("is not a path",)),
    ("lower = 0.4", "lower = 0.9", ("lower is 0.9 and upper is 0.8",)),
    ('"uniform"', '"unifrom"', ("did you mean 'uniform'",)),
    ("lower = 0.4", "lower = -0.2", ("friction_coefficient is -", "at least 0: its distribution", "limit it by lower")),
    (
        '"uniform", lower = 0.4, upper = 0.8',
        '"normal", mean = 0.2, deviation = 0.2',
        ('[parameters] "material.friction_coefficient": ', "friction_coefficient is -", "limit it by lower"),
    ),
    ('"latin hypercube"', '"latin cube"', ("did you mean 'latin hypercube'",)),
    ("runs = 8", "runs = 0", ("runs is 0", "at least 1")),
    ("runs = 8", "rums = 8", ("did you mean 'runs'",)),
    ('"case.toml"', '"cave.toml"', ("there is no case file", "case.toml")),
    ('name = "friction"', 'name = "status"', ("column of the table already",)),
    ('method = "latin hypercube"\nruns = 8', 'method = "grid"', ("a grid needs points",)),
    (
        "upper = 0.8",
        "upper = 0.8, points = 1",
        ('friction_coefficient"] points is 1; give a whole number of at least 2',),
    ),
    ('"latin hypercube"\nruns = 8', '"sobol"\nruns = 12', ("runs is 12; ", " give 8 or 16")),
    (
        "upper = 0.8",
        "upper = 0.8, points = 4",
        ('"material.friction_coefficient": points belong to a grid; give [study] runs',),
    ),
    ("upper = 0.8", "upper = 0.8, points = 2.5", ("points is 2.5; give a whole number of at least 2",)),
    ("upper = 0.8", "upper = 0.8, points = true", ("points is True; give a whole number of at least 2",)),
    ("upper = 0.8", 'upper = 0.8, points = "5"', ("points is '5'; give a whole number of at least 2",)),
    ("runs = 8", "runs = 100000000000", ("[study] makes 100,000,000,000 runs; at most 1,000,000",)),
    ("seed = 3", "seed = 3\nkeep = [9]", ("keep names run 9", "0 to 7")),
    ("[study]", "[studie]", ("did you mean 'study'",)),
    ("runs = 8", "runs = 8,5", ("has a decimal comma", "runs = 8.5")),
    ('"case.toml"', '"cases\\m.toml"', ("write paths with / or in single quotes", "a study file is TOML")),
    ("seed = 3", f"seed = {'[' * 3000}", ("nests lists or tables without end",)),
]


def test_a_study_does_not_hang_on_its_first_run(study_file, capsys):
    values = '"geometry.parameters.voussoirs" = [1, 8, 9]\n"material.density" = [1900, 2000]\n'
    text = STUDY.partition("[parameters]")[0].replace("runs = 8\n", "").replace("latin hypercube", "grid")
    study_file.write_text(f"{text}[parameters]\n{values}", encoding="utf-8")
    assert read_study(study_file).n_runs == 6
    _with(study_file, "[1, 8, 9]", "[1, 0]")
    assert "run 0 cannot be built, nor can others of the study: " in _refused(study_file, capsys)


def test_imperfections_of_a_kind_that_the_case_has_are_refused_by_the_study(study_file, capsys):
    more = '[[imperfections]]\nkind = "friction"\ndistribution = "lognormal"\ndeviation = 0.1\n'
    _added(study_file.parent / "case.toml", f"{more}seed = 1\n")
    _added(study_file, more)
    said = _refused(study_file, capsys)
    assert "study.toml: with its [[imperfections]] behind those of the case, " in said
    assert "[imperfections 2] kind 'friction' is there twice" in said


def test_settlements_in_m_and_in_rad_are_no_study(study_file, capsys):
    turn = "[[settlement]]\nrotation_centre = [1.0, 0.0]\nincrement = 0.001\nlimit = 0.002\n"
    (study_file.parent / "case.toml").write_text(CASE + turn, encoding="utf-8")
    message = _refused(study_file, capsys)
    assert "settlement 1 of run 0 (" in message
    assert ") is in m and settlement 2 of run 0 (" in message
    assert ") is in rad; leave out those of one" in message


def test_runs_in_m_and_in_rad_are_no_study(study_file, capsys):
    tables = "{direction = [1.0, 0.0], limit = 0.1}, {rotation = 1.0, rotation_centre = [1.0, 0.0], limit = 0.1}"
    study = f'[study]\ncase = "case.toml"\n[parameters]\nsettlement = [{tables}]\n'
    study_file.write_text(study, encoding="utf-8")
    message = _refused(study_file, capsys)
    assert "(settlement = {'direction': [1.0, 0.0], 'limit': 0.1}) is in m and settlement 1 of run " in message
    assert "(settlement = {'rotation': 1.0," in message


@pytest.mark.parametrize(("old", "new", "words"), BAD, ids=[b[1][:24] for b in BAD])
def test_bad_input_is_one_message_and_nothing_started(study_file, capsys, old, new, words):
    _with(study_file, old, new)
    message = _refused(study_file, capsys)
    assert message.count("\n") == 1, message
    for word in ("study.toml", *words):
        assert word in message


def test_nothing_varied_is_refused(tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    with pytest.raises(ValueError, match="nothing is varied"):
        read_study({"study": {"case": str(tmp_path / "case.toml")}})


@pytest.mark.slow
def test_an_unreachable_scheduler_is_one_message_and_nothing_started(study_file, capsys, monkeypatch):
    monkeypatch.setattr(campaign, "ANSWER", 0.5)
    message = _refused(study_file, capsys, "--scheduler", "tcp://127.0.0.1:9")
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in message
    assert "dask scheduler" in message


@pytest.mark.parametrize(
    ("name", "runs"), [("arch_friction", 256), ("panel_settlement_friction", 36), ("wall_acceleration", 40)]
)
def test_shipped_studies_are_studies(name, runs):
    study = read_study(Path(__file__).parents[2] / "examples" / "studies" / f"{name}.toml")
    assert study.n_runs == runs


ARCH = {"geometry": {"layout": "arch"}, "settlement": {"direction": [1, 0]}}


def _study(method="latin hypercube", runs=256, scattered=False, parameters=None):
    given = {
        "study": {"case": ARCH, "method": method, "seed": 2} | ({} if method == "grid" else {"runs": runs}),
        "parameters": parameters
        or {
            "material.friction_coefficient": {"name": "a", "distribution": "uniform", "lower": 0.0, "upper": 1.0},
            "material.density": {"name": "b", "distribution": "uniform", "lower": 1000.0, "upper": 2000.0},
        },
    }
    if scattered:
        given["imperfections"] = [{"kind": "density", "distribution": "lognormal", "deviation": 0.1}]
    return read_study(given)


def _table(study, outcome, status=None):
    """The table that a study would have if this were the collapse displacement of every run."""
    points = [study.point(run) for run in range(study.n_runs)]
    n = study.n_runs
    return pd.DataFrame(
        {
            "run": range(n),
            "status": status or ["collapsed"] * n,
            **{name: [p[name] for p in points] for name in points[0]},
            "collapse_displacement": outcome,
            "last_settlement": np.nan_to_num(outcome),
            "load_multiplier": np.nan,
            "unit": "m",
            "mechanism_class": "1 part",
            "falling_share": 1.0,
            "message": "",
            "seconds": 0.1,
        }
    )


# Remission of leukaemia under 6-mercaptopurine [weeks]: Freireich et al., Blood 21 (1963) 699-716; the estimates and
# Greenwood's standard errors are in textbooks of survival analysis.
WEEKS = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
RELAPSE = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
STANDING = {6: 0.857, 7: 0.807, 10: 0.753, 13: 0.690, 16: 0.627, 22: 0.538, 23: 0.448}


def test_kaplan_meier_of_published_data():
    curve = fragility(WEEKS, RELAPSE)
    assert curve.settlement.tolist() == list(STANDING)
    np.testing.assert_allclose(1.0 - curve.probability, list(STANDING.values()), atol=5e-4)
    assert (curve.n_runs, curve.n_stood, curve.furthest) == (21, 12, 35.0)
    reference = st.ecdf(st.CensoredData.right_censored(WEEKS, np.logical_not(RELAPSE))).sf
    np.testing.assert_allclose(1.0 - curve.probability, reference.evaluate(curve.settlement), rtol=1e-12)
    assert curve.quantile(0.5) == (23, 23)
    assert curve.quantile(0.9) == (None, None)


def test_band_is_wilsons_with_the_effective_number():
    curve = fragility(WEEKS, RELAPSE)
    # By hand at 10 weeks: S = 0.75294, Greenwood's error 0.0963, so that the effective number is S (1 - S) / error².
    s, error = 0.752941, 0.096350
    low, high = wilson(1.0 - s, s * (1.0 - s) / error**2)
    k = curve.settlement.tolist().index(10)
    assert (curve.lower[k], curve.upper[k]) == (
        pytest.approx(float(low), abs=1e-4),
        pytest.approx(float(high), abs=1e-4),
    )


def test_without_runs_that_stood_it_is_the_binomial_at_each_displacement():
    displacement = np.array([0.3, 0.1, 0.2, 0.2, 0.5])
    curve = fragility(displacement, np.ones(5, dtype=bool))
    np.testing.assert_allclose(curve.probability, [0.2, 0.6, 0.8, 1.0])
    for share, low, high in zip([1, 3, 4, 5], curve.lower, curve.upper, strict=True):
        exact = st.binomtest(share, 5).proportion_ci(method="wilson")
        assert (low, high) == (pytest.approx(exact.low), pytest.approx(exact.high))


def test_runs_that_all_stood_make_no_step_and_the_largest_one_counts():
    curve = fragility([0.1, 0.2], [False, False])
    assert len(curve.settlement) == 0
    assert curve.furthest == 0.2
    # One that stood up to the very settlement of a collapse was at risk there.
    assert fragility([0.1, 0.1], [True, False]).probability.tolist() == [0.5]


def test_band_covers_the_truth_as_often_as_it_says():
    random, inside, all_ = np.random.default_rng(3), 0, 0
    for _ in range(400):
        collapse, followed = random.exponential(1.0, 60), random.uniform(0.5, 3.0, 60)
        curve = fragility(np.minimum(collapse, followed), collapse <= followed)
        k = np.searchsorted(curve.settlement, 0.7) - 1
        truth = 1.0 - np.exp(-0.7)
        inside += curve.lower[k] <= truth <= curve.upper[k]
        all_ += 1
    assert 0.92 < inside / all_ < 0.98


def test_runs_without_result_are_counted_and_only_those_that_were_not_built_are_left_out():
    study = _study(runs=8)
    y = np.arange(1.0, 9.0)
    y[[2, 5, 6]] = np.nan
    status = ["collapsed"] * 8
    status[2], status[5], status[6] = "failed", "limit reached", "not built"
    table = _table(study, y, status)
    table.loc[5, "last_settlement"] = 4.5
    table.loc[[2, 6], "last_settlement"] = np.nan
    table.loc[[2, 6], "message"] = "out of memory", "overlaps"
    curve = fragility_of(table)
    assert (curve.n_runs, curve.n_stood, curve.n_broken_off) == (7, 1, 1)
    assert (curve.settlement[0], curve.probability[0], curve.at_most[0]) == (0.0, 0.0, pytest.approx(1 / 7))
    summary = summary_of(study, table)
    assert (summary["n_without_result"], summary["n_not_built"]) == (2, 1)
    said = in_words(summary)
    assert "1 failed" in said
    assert "without result, 1 time: out of memory" in said
    assert "not built, and left out of what follows: 1 run\n" in said
    assert "1 run without result were left at 0 m" not in said
    assert "1 run without result was left at 0 m, and may collapse there or never" in said


def test_a_curve_holds_wherever_runs_that_were_broken_off_collapse():
    """They are broken off as they collapse: what is left of the sample is those that stand."""
    random = np.random.default_rng(4)
    for _ in range(20):
        collapse, limit = random.exponential(1.0, 30), random.uniform(0.5, 3.0, 30)
        end, fell = np.minimum(collapse, limit), collapse <= limit
        broken_off = random.random(30) < 0.3
        left = np.where(broken_off, end * random.uniform(0.5, 1.0, 30), end)
        truth, curve = fragility(end, fell), fragility(left, fell & ~broken_off, broken_off)
        at = np.searchsorted(truth.settlement, curve.settlement, side="right")
        probability = np.append(0.0, truth.probability)[at]
        assert (curve.probability <= probability + 1e-12).all()
        assert (probability <= curve.at_most + 1e-12).all()
        first, last = curve.quantile(0.3)
        assert first <= truth.quantile(0.3)[0]
        assert last is None or last >= truth.quantile(0.3)[0]


def test_where_runs_take_too_long_nothing_is_said_of_those_that_stand_alone(tmp_path):
    """A run takes its time where it collapses."""
    study = _study(runs=20)
    table = _table(study, np.full(20, np.nan), ["interrupted"] * 19 + ["limit reached"])
    table["last_settlement"] = np.append(np.linspace(0.068, 0.126, 19), 0.14)
    table.loc[:18, "message"] = "took longer than 1.8 s"
    summary = summary_of(study, table)
    assert (summary["probability_at_the_end"], summary["probability_at_the_end_at_most"]) == (0.0, pytest.approx(0.95))
    assert (summary["quantiles"]["0.05"], summary["quantile_bounds"]["0.05"]) == (None, [0.068, None])
    said = in_words(summary)
    assert "19 runs without result were left at 0.068 to 0.126 m, and may collapse there or never" in said
    assert "probability of collapse: 5 % not before 0.068 m, 50 % not before 0.097 m, 95 % not before 0.126 m" in said
    assert "settlement.limit" not in said
    assert "no run collapsed" not in said
    drawn = pictures.draw_fragility(study, table, tmp_path / "fragility.svg").read_text(encoding="utf-8")
    assert "20 runs, 0 collapsed, 1 stood (up to 140 mm), 19 without result" in drawn
    assert "half not before 97 mm" in drawn
    # One of them has collapsed: what is known of the others is no more than how far they came.
    table.loc[3, ["status", "collapse_displacement"]] = "collapsed", 0.1
    said = in_words(summary_of(study, table))
    assert re.search(r"^a: at least 0\.\d+ m on average at 0\.\d+, at least ", said, re.M)
    assert "no shares of the variance: 19 runs without collapse" in said


def test_reasons_that_differ_in_numbers_only_are_counted_together():
    study = _study(runs=8)
    table = _table(study, np.full(8, np.nan), ["failed"] * 8)
    table["message"] = [f"off by {k}.5e-0{k} m" for k in range(1, 8)] + ["out of memory"]
    assert summary_of(study, table)["reasons"] == {"off by 1.5e-01 m": 7, "out of memory": 1}


def test_title_and_words_count_what_collapsed_and_what_never_stood_apart():
    study = _study(runs=8)
    status = ["collapsed"] * 4 + ["no initial equilibrium"] * 2 + ["limit reached", "solver failed"]
    table = _table(study, [0.1, 0.2, 0.3, 0.4, 0.0, 0.0, np.nan, np.nan], status)
    # Of those that never stood none is a loss of a structure that stands.
    table.loc[[1, 4], "falling_share"] = 0.02
    summary = summary_of(study, table)
    assert (summary["n_collapsed"], summary["n_never_stood"], summary["n_local"]) == (4, 2, 1)
    assert "4 collapsed, 2 no initial equilibrium" in in_words(summary)
    assert "1 of the collapses is a local loss: a few blocks fall, the structure stands" in in_words(summary)
    title = pictures.runs_counted(fragility_of(table), table, 1e3, "mm")
    assert title.startswith("8 runs, 4 collapsed (1 of a few blocks only), 2 never stood, 1 stood")


def test_values_chosen_by_hand_are_no_sample():
    study = _study("grid", parameters={"material.friction_coefficient": {"name": "a", "values": [0.4, 0.5]}})
    assert is_single(study)
    assert not is_sample(study)
    assert is_sample(_study())
    summary = summary_of(study, _table(study, [0.1, 0.2]))
    assert summary["first_order_indices"] == {}, "one value per run explains all of the variance"
    summary = summary_of(study, _table(study, [0.0, 0.2], ["no initial equilibrium", "collapsed"]))
    assert "collapse by a, 0.4: none (no initial equilibrium); 0.5: 0.2 m" in in_words(summary)
    assert "share" not in in_words(summary), "each value has its run"


@pytest.fixture(scope="module")
def linear():
    """A study of two parameters, and its table if runs collapsed at 2 a + b / 1000."""
    study = _study()
    table = _table(study, np.zeros(study.n_runs))
    table["collapse_displacement"] = 2.0 * table["a"] + table["b"] / 1000.0
    return study, table


@pytest.mark.parametrize("of_the_first", [pytest.param(0.15, marks=pytest.mark.thorough), 0.14])
def test_an_outcome_that_one_run_has_alone_or_that_never_changes_has_no_index(linear, of_the_first):
    study, table = linear
    outcome = np.where(np.arange(study.n_runs) < 1, of_the_first, 0.14)
    assert first_order(study, table.assign(collapse_displacement=outcome)) == {}


def test_first_order_indices_of_a_linear_function(linear):
    study, table = linear
    found = first_order(study, table)
    # Var(2 a) : Var(b) = 4 : 1.
    assert found["a"][0] == pytest.approx(0.8, abs=0.03)
    assert found["b"][0] == pytest.approx(0.2, abs=0.08)


@pytest.mark.thorough
def test_an_index_has_an_error_of_what_chance_does():
    """Of a grid the repeats alone: its values are all that there are."""
    study = _study("grid", parameters={"material.friction_coefficient": {"name": "a", "values": [0.4, 0.5]}})
    assert first_order(study, _table(study, [0.430128095527909, 0.026456931899677537]))["a"] == (
        pytest.approx(1.0),
        0.0,
    )
    values = {"material.friction_coefficient": [0.3, 0.4, 0.5], "material.density": [1900.0, 2000.0]}
    names = list(values)
    study = replace(_study("grid", scattered=True, parameters=values), repeats=4)
    exact, told = np.array([8 / 12, 3 / 12]) / (11 / 12 + 0.01), []
    for seed in range(60):
        table = _table(study, np.zeros(24))
        table["collapse_displacement"] = (
            10.0 * table[names[0]] + table[names[1]] / 100.0 + np.random.default_rng(seed).normal(scale=0.1, size=24)
        )
        told.append([first_order(study, table)[name] for name in names])
    share, error = np.moveaxis(np.array(told), -1, 0)
    assert np.abs(share.mean(axis=0) - exact).max() < 0.01
    inside = np.abs(share - exact) < error
    assert inside.mean() > 0.7, "of three degrees of freedom"
    assert error.max() < 0.2


def test_shares_of_the_variance_are_of_collapses_and_not_of_the_limit():
    values = {"material.friction_coefficient": {"name": "a", "values": [0.38, 0.45, 0.6]}}
    values["material.density"] = {"name": "b", "values": [1800.0, 1900.0, 2000.0, 2100.0]}
    study = _study("grid", parameters=values)
    collapse = np.array([0.02, 0.04, 0.06, 0.08, 0.05, 0.07, 0.09, 0.11, 0.1, 0.12, 0.2, 0.22])
    for limit, stood in ((0.4, 0), (0.12, 3), (0.06, 9)):
        table = _table(study, np.where(collapse < limit, collapse, np.nan))
        table["last_settlement"] = np.minimum(collapse, limit)
        table["status"] = np.where(collapse < limit, "collapsed", "limit reached")
        said = in_words(summary_of(study, table))
        assert ("% of the variance" in said) == (stood == 0)
        assert (f"no shares of the variance: {stood} runs without collapse" in said) == (stood > 0)
    said = in_words(summary_of(study, _table(study, collapse)))
    assert re.search(r"^a: .* \d+ % of the variance$", said, re.M), "nothing is drawn: no error"
    # The first is not built: the values have not the same partners.
    assert first_order(study, _table(study, [np.nan, *collapse[1:]], ["not built"] + ["collapsed"] * 11)) == {}
    gone = np.where(np.arange(12) < 4, np.nan, collapse)
    partly = first_order(study, _table(study, gone, ["not built"] * 4 + ["collapsed"] * 8))
    assert sum(share for share, _ in partly.values()) == pytest.approx(1.0, abs=0.1), "a value less is a smaller grid"


@pytest.mark.parametrize("method", ["random", "saltelli"])
@pytest.mark.slow
def test_the_interval_of_a_mean_holds_the_truth_as_often_as_it_says(method):
    """The rows of a saltelli design share their imperfections: they are no further draws."""
    parameters = {
        f"geometry.parameters.{key}": {"name": key, "distribution": "uniform", "lower": low, "upper": high}
        for key, low, high in (("thickness_ratio", 0.12, 0.2), ("radius", 1.0, 2.0), ("embrace", 150.0, 170.0))
    }
    inside, base = [], _study(method, 16 if method == "saltelli" else 64, scattered=True, parameters=parameters)
    for seed in range(100):
        study = replace(base, seed=seed)
        noise = np.array([np.random.default_rng(s).normal() for s in study.design.seeds.tolist()])
        table = _table(study, noise)
        inside += [abs(end) < error for s in swings(study, table) for end, error in ((s.low, s.low_error),)]
    assert np.mean(inside) > 0.8, "few are compared: not 0.95"


@pytest.mark.slow
def test_first_order_indices_by_exchange_with_imperfections():
    study = _study("saltelli", 256, scattered=True)
    assert study.n_runs == 256 * 5
    noise = np.array([np.random.default_rng(s).uniform() for s in study.design.seeds.tolist()])
    table = _table(study, np.zeros(study.n_runs))
    table["collapse_displacement"] = 2.0 * table["a"] + table["b"] / 1000.0 + noise
    table.loc[7, ["status", "collapse_displacement"]] = ["not built", np.nan]
    found = first_order(study, table)
    for name, exact in (("a", 4 / 6), ("b", 1 / 6), (IMPERFECTIONS, 1 / 6)):
        assert found[name][0] == pytest.approx(exact, abs=0.08), name
        assert abs(found[name][0] - exact) < 2.0 * found[name][1]


def test_first_order_indices_of_a_grid_are_exact():
    study = _study(
        "grid", parameters={"material.friction_coefficient": [0.0, 1.0, 2.0], "material.density": [1.0, 2.0]}
    )
    table = _table(study, np.zeros(6))
    x, y = table["material.friction_coefficient"], table["material.density"]
    table["collapse_displacement"] = x * y
    # Means over y: 0, 1.5, 3; over x: 1, 2.
    total = np.var([0, 0, 1, 2, 2, 4])
    assert first_order(study, table)["material.friction_coefficient"][0] == pytest.approx(np.var([0, 1.5, 3]) / total)
    assert first_order(study, table)["material.density"][0] == pytest.approx(np.var([1, 2]) / total)


def test_swings_compare_the_lowest_and_the_highest_fifth(linear):
    first, second = swings(*linear)
    assert (first.name, second.name) == ("a", "b")
    # Of a uniform variable on 0 to 1 the fifths have the means 0.1 and 0.9.
    assert first.low_value == pytest.approx(0.1, abs=0.01)
    # What the other parameter adds scatters: three times its deviation over the root of 51 runs on either side.
    assert first.high - first.low == pytest.approx(1.6, abs=3 * np.sqrt(2 / 12 / 51))
    assert second.high - second.low == pytest.approx(0.8, abs=3 * np.sqrt(2 * 4 / 12 / 51))


@pytest.mark.parametrize("points", [3, 4, 5])
def test_swings_of_a_grid_are_between_the_ends_of_its_parameters(points):
    """Also of one with a distribution, whatever the number of its points: the other has each value beside each."""
    given = {"distribution": "uniform", "lower": 1000.0, "upper": 2000.0, "points": points}
    parameters = {"material.density": given, "material.friction_coefficient": [0.4, 0.5, 0.6, 0.7, 0.8]}
    study = _study("grid", parameters=parameters)
    table = _table(study, np.zeros(study.n_runs))
    table["collapse_displacement"] = table["material.friction_coefficient"]
    friction, density = swings(study, table)
    assert (friction.low, friction.high) == pytest.approx((0.4, 0.8))
    assert (density.low, density.high) == pytest.approx((0.6, 0.6))
    assert density.low_value < density.high_value


@pytest.mark.slow
def test_a_study_in_which_nothing_collapses_says_nothing_of_a_collapse(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(CASE.replace("limit = 0.3", "limit = 0.001"), encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("runs = 8", "runs = 2"), encoding="utf-8")
    assert main(["sweep", str(path), "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    said = capsys.readouterr().out
    unknown = "what each parameter does to a collapse is not known: let settlement.limit be larger; last reactions and"
    assert f"no run collapsed as far as it was followed, at most 0.001 m; {unknown}" in said
    assert "average" not in said
    table = pd.read_csv(tmp_path / "out" / "table.csv")
    assert (table["last_reaction"] > 0.0).all()
    assert table["collapse_reaction"].isna().all()
    assert table["largest_opening"].between(1e-5, 2e-3).all()
    assert not (tmp_path / "out" / "sensitivity.png").exists()


@pytest.mark.slow
def test_a_run_is_kept_with_its_photograph_and_thrown_away_with_its_study(study_file, capsys):
    """An interrupted one is made again."""
    folder = study_file.parent
    Image.new("RGB", (40, 20), "grey").save(folder / "photo.png")
    (folder / "photo.pgw").write_text("0.1\n0\n0\n-0.1\n-2\n1.5\n", encoding="utf-8")
    study_file.write_text(STUDY.replace("runs = 8", "runs = 1\nkeep = 0"), encoding="utf-8")
    summary, limits = folder / "out" / "results" / "run_000000" / "summary.json", []
    for limit, force in (("0.001", ()), ("0.002", ("--force",))):
        case = CASE.replace("limit = 0.3", f"limit = {limit}") + 'underlay = "photo.png"\n'
        (folder / "case.toml").write_text(case, encoding="utf-8")
        assert main(["sweep", str(study_file), "-o", str(folder / "out"), "--workers", "1", *force]) == 0
        limits.append(json.loads(summary.read_text(encoding="utf-8"))["last_settlement"])
    assert limits == [0.001, 0.002]
    done = summary.read_text(encoding="utf-8")
    summary.write_text(done.replace("limit reached", "interrupted"), encoding="utf-8")
    assert main(["sweep", str(study_file), "-o", str(folder / "out")]) == 0
    assert json.loads(summary.read_text(encoding="utf-8"))["status"] == "limit reached"


def test_means_with_runs_that_stood_are_the_least_that_they_may_be(tmp_path):
    study = _study(runs=10)
    table = _table(study, np.linspace(0.1, 0.2, 10))
    stood = table["a"] > 0.85
    table["status"] = np.where(stood, "limit reached", table["status"])
    table["last_settlement"] = 0.3
    table.loc[stood, "collapse_displacement"] = np.nan
    said = in_words(summary_of(study, table))
    assert re.search(r"^a: 0\.\d+ m on average at 0\.\d+, at least 0\.\d+ m at ", said, re.M)
    drawn = pictures.draw_sensitivity(study, table, tmp_path / "sensitivity.svg").read_text(encoding="utf-8")
    assert f"at least: {mechanics.counted(int(stood.sum()), 'run')} without collapse" in drawn
    assert "share of the variance" not in drawn


@pytest.mark.thorough
def test_values_stand_where_their_means_are(tmp_path, monkeypatch):
    """Also of two means to one side of that of all runs; the title of either panel keeps to it."""
    path = "geometry.parameters.voussoirs"
    study, beside = _study(runs=64, parameters={path: [10, 11, 12]}), {}
    table = _table(study, np.zeros(64))
    rows = table[path].map({10: 1.0, 11: 0.0, 12: 0.9}) + 0.001 * np.arange(64)
    table["collapse_displacement"] = rows
    (swing,) = swings(study, table)
    assert min(swing.low, swing.high) > rows.mean()
    with monkeypatch.context() as patched:
        patched.setattr(
            "matplotlib.axes.Axes.annotate",
            lambda axes, words, at, xytext, **look: beside.update({words: (at[0], xytext[0])}),
        )
        saved, kept = pictures.saved, []
        patched.setattr(pictures, "saved", lambda figure, *file: kept.append(figure) or saved(figure, *file))
        pictures.draw_sensitivity(study, table, tmp_path / "sensitivity.svg")
    low, high = beside["12"], beside["10"]
    assert low[0] <= rows.mean() < swing.low <= high[0]
    assert (low[1], high[1]) == (-6, 6)
    left, right = (axes._left_title.get_window_extent() for axes in kept[0].axes)
    assert left.x1 < right.x0
    kept[0].clear()
    with monkeypatch.context() as patched:
        patched.setattr(pictures, "saved", lambda figure, *file: kept.append(figure))
        pictures.draw_scatter(study, table, tmp_path / "scatter.svg")
    assert all(tick == round(tick) for tick in kept[-1].axes[0].get_xticks().tolist()), "whole stones"


def test_no_error_strikes_a_value_through(tmp_path, monkeypatch):
    """Both ends of a swing lie in one line: each value stands beyond the errors of both."""
    study, reach, beside = _study(runs=24), {-1: {}, 1: {}}, []

    def errorbar(axes, x, y, xerr, **look):
        for side, found in reach.items():
            found[y] = max(found.get(y, -np.inf), side * x + xerr)

    monkeypatch.setattr("matplotlib.axes.Axes.errorbar", errorbar)
    monkeypatch.setattr("matplotlib.axes.Axes.annotate", lambda *of, xytext, **look: beside.append((*of[2], xytext[0])))
    outcome = np.random.default_rng(1).exponential(size=24)
    pictures.draw_sensitivity(study, _table(study, outcome), tmp_path / "sensitivity.svg")
    sides = [(int(np.sign(away)), x, y) for x, y, away in beside]
    assert len(sides) == 4
    assert all(side * x >= reach[side][y] - 1e-9 for side, x, y in sides), (sides, reach)


def test_where_nothing_ever_stands_displacements_are_drawn_without_words_of_matplotlib(tmp_path):
    study = _study(runs=8)
    table = _table(study, np.zeros(8), ["no initial equilibrium"] * 8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert pictures.draw_scatter(study, table, tmp_path / "scatter.svg").is_file()


def test_a_study_that_is_run_as_a_case_is_told_its_command(study_file, capsys):
    assert main(["run", str(study_file)]) == 2
    assert f"[study] makes it a study; carry it out by: blockvis sweep {study_file}" in capsys.readouterr().err


def test_kinds_that_collapse_at_other_numbers_are_no_study(study_file, capsys):
    live = '[[loads]]\nkind = "live"\nweight_fraction = [1, 0]\n'
    (study_file.parent / "case.toml").write_text(CASE + live, encoding="utf-8")
    study_file.write_text(
        '[study]\ncase = "case.toml"\n[parameters]\n"analysis.kind" = ["settlement", "limit load"]\n', encoding="utf-8"
    )
    said = _refused(study_file, capsys)
    assert re.search(r"load multiplier 1 of run \d+ \(analysis.kind = 'limit load'\) is without unit", said)
    assert "(analysis.kind = 'settlement') is in m" in said
