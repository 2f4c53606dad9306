"""The report on paper, by ``blockvis report OUT --pdf``."""

import json
import re

import pytest
from PIL import Image
from structures import dropped_brick, moved_and_turned, rectangle, vault_response

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main


@pytest.mark.slow
def test_the_report_on_paper_has_pictures_and_pages(arch_results, capsys):
    assert main(["report", str(arch_results), "--pdf"]) == 0
    assert capsys.readouterr().out == f"written in {arch_results}/: report.html, report.pdf\n"
    pages = (arch_results / "report.pdf").read_bytes()
    assert 2 <= len(re.findall(rb"/Type /Page\b(?!s)", pages)) <= 4
    assert b"/MediaBox [0 0 595.28 841.89]" in pages
    # Mechanism, last equilibrium and curve, each at 200 dots per inch or more over 140 to 174 mm.
    widths = [int(width) for width in re.findall(rb"/Width (\d+)", pages)]
    assert len(widths) >= 3
    assert min(widths) >= 140 / 25.4 * 200


@pytest.mark.slow
def test_upright_pictures_on_paper_fit_on_the_page_of_their_heading(tmp_path, monkeypatch):
    placed = []

    def noted(paper, path, x, w):
        with Image.open(path) as image:
            placed.append((paper.get_y(), w * image.height / image.width, x, w))

    monkeypatch.setattr("blockvis.report.pdf._Paper.image", noted)
    tower = solver.Structure(generators.column(blocks=30, width=1.0, block_height=1.0), friction_coefficient=0.7)
    sinks = solver.Settlement((0.0, -1.0), increment=0.01, limit=0.01)
    blockvis.write(tower.settle(sinks), tmp_path / "out")
    assert main(["report", str(tmp_path / "out"), "--pdf"]) == 0
    assert [round(height) for _, height, _, _ in placed[:2]] == [175, 175]
    for top, height, left, width in placed:
        assert top + height < 297.0 - 18.0
        assert left + width / 2.0 == pytest.approx(105.0)


def test_a_report_of_nothing_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path), "--pdf"]) == 2
    assert "holds no results" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_view_is_of_the_report_on_paper(arch_folder, capsys):
    assert main(["report", str(arch_folder), "--view", "below"]) == 2
    assert "--view and --section are of the report on paper, report.html turns; add --pdf" in capsys.readouterr().err


@pytest.mark.slow
def test_blocks_in_space_are_on_paper_as_they_are_asked_for(tmp_path, monkeypatch):
    seen = []

    def noted(response, *places, **words):
        seen.append((words["view"], words["section"]))
        return blockvis.draw_curve(response, places[-1])

    for name in ("draw_mechanism", "draw_still", "draw_cracks"):
        monkeypatch.setattr(f"blockvis.report.pdf.{name}", noted)
    response = vault_response()
    blockvis.write(response, tmp_path / "out")
    assert main(["report", str(tmp_path / "out"), "--pdf", "--view", "30,20", "--section", "y = 0.2"]) == 0
    assert seen == [({"azimuth": 30, "elevation": 20}, "y = 0.2")] * 3


def tables_on_paper(folder, monkeypatch):
    """Title, head, rows and widths of each table."""
    tables = []
    monkeypatch.setattr("blockvis.report.pdf._Paper.tabulate", lambda _, *table: tables.append(table))
    assert main(["report", str(folder), "--pdf"]) == 0
    return tables


def states_on_paper(response, folder, monkeypatch):
    tables = tables_on_paper(blockvis.write(response, folder / "out"), monkeypatch)
    return next(table for table in tables if table[0].startswith("States"))


@pytest.mark.slow
def test_the_table_of_cracks_says_what_they_run_between(arch_results, monkeypatch):
    tables = tables_on_paper(arch_results, monkeypatch)
    rows, widths = next(table[2:] for table in tables if table[0] == "Cracks at the last equilibrium")
    assert sum(widths) <= 174.0
    ends = [end for row in rows for end in row[-2:]]
    assert any(re.fullmatch(r"the (ground|top), at -?\d+\.\d\d, -?\d+\.\d\d", end) for end in ends), ends


@pytest.mark.slow
def test_keys_that_are_not_in_use_are_not_on_paper(arch_results, monkeypatch):
    listed = []
    monkeypatch.setattr("blockvis.report.pdf._Paper.listing", lambda _, title, text: listed.append(text))
    case = (
        '# An arch.\n[geometry]\nfile = "arch#1.msh"\n# [material]\n# density = 2000.0  # kg/m³\n\n\n\n'
        "[settlement]\ndirection = [1, 0]\nlimit = 0.5  # m\n"
    )
    record = arch_results / "run.json"
    record.write_text(json.dumps(json.loads(record.read_text(encoding="utf-8")) | {"case": case}), encoding="utf-8")
    assert main(["report", str(arch_results), "--pdf"]) == 0
    assert listed == ['[geometry]\nfile = "arch#1.msh"\n\n[settlement]\ndirection = [1, 0]\nlimit = 0.5  # m']


@pytest.mark.slow
def test_states_of_a_rotation_are_told_in_rad_with_their_moment(tmp_path, monkeypatch):
    response = moved_and_turned()
    title, _, rows, _ = states_on_paper(response, tmp_path, monkeypatch)
    last = response.path[-1].measured
    assert title == "States"
    assert rows[1][0] == "1.00 mm, phase 1"
    assert rows[1][1].endswith(" kN")
    assert rows[-1] == ("0.00100 rad, phase 2", f"{last:.4g} N·m", "")


@pytest.mark.slow
def test_states_of_moments_alone_have_no_column_of_weights(tmp_path, monkeypatch):
    column = solver.Assembly.from_outlines([rectangle(0, -1, 1, 0), rectangle(0, 0, 1, 2)], roles=["moving", "free"])
    turns = solver.Settlement(rotation=1.0, rotation_centre=(0.0, 0.0), increment=1e-3, limit=2e-3)
    response = solver.settle(column, turns, friction_coefficient=0.6)
    title, head, rows, widths = states_on_paper(response, tmp_path, monkeypatch)
    assert (title, len(head), len(widths)) == ("States", 2, 2)
    assert all(len(row) == 2 and row[1].endswith("N·m") for row in rows)


@pytest.mark.slow
def test_states_that_are_left_out_are_told_and_what_matters_stays(tmp_path, monkeypatch):
    response = dropped_brick(0.05)
    title, _, rows, _ = states_on_paper(response, tmp_path, monkeypatch)
    chosen, last = len(rows), response.path[-1].parameter
    with_them = "evenly chosen, with the largest, the last before blocks are lost and the last"
    assert title == f"States: {chosen} of {len(response.path)}, {with_them}"
    before = max(i.parameter for i in response.path if not i.fallen.any())
    largest = max(response.path, key=lambda increment: increment.measured).parameter
    assert {f"{at:.4f} m" for at in (before, largest, last)} <= {row[0] for row in rows}


@pytest.mark.slow
def test_the_largest_force_and_the_largest_moment_are_not_compared(tmp_path, monkeypatch):
    response = moved_and_turned()
    largest = max(response.path[:2], key=lambda increment: increment.measured)
    monkeypatch.setattr("blockvis.report.pdf.MOST_STATES", 2)
    title, _, rows, _ = states_on_paper(response, tmp_path, monkeypatch)
    assert "with the largest of each unit and the last" in title
    assert f"{1e3 * largest.parameter:.2f} mm, phase 1" in [row[0] for row in rows]
    assert {row[1].split()[-1] for row in rows} == {"kN", "N·m"}
