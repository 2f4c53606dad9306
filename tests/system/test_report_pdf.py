"""The report on paper, by ``blockvis report OUT --pdf``."""

import re

import pytest

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


def test_a_report_of_nothing_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path), "--pdf"]) == 2
    assert "holds no results" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
