"""Reports and answers survive every number and every text that a journal can hold."""

import json
import re
from pathlib import Path

import pytest
from nasty import nasty_run, nasty_view
from pypdf import PdfReader

from reports import write_report
from reports.answer import answer


@pytest.mark.parametrize("seed", range(10))
def test_every_run_has_a_report_and_an_answer(tmp_path: Path, seed: int) -> None:
    run, html = nasty_run(tmp_path / "run", seed), tmp_path / "r.html"
    write_report(run, html=html, describe=nasty_view(seed))
    page = html.read_text(encoding="utf-8")
    assert page.rstrip().endswith("</html>")
    assert not re.search("[\x00-\x08\x0b-\x1f\ud800-\udfff]", page)
    json.dumps(answer(run), allow_nan=False)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_run_can_be_printed(tmp_path: Path, seed: int) -> None:
    pages = {"html": tmp_path / "r.html", "pdf": tmp_path / "r.pdf"}
    write_report(nasty_run(tmp_path / "run", seed), describe=nasty_view(seed), **pages)
    assert len(PdfReader(pages["pdf"]).pages) >= 1
