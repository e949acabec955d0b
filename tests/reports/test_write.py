"""Whole reports: finished, broken off, empty, and of a user's own problem."""

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest

from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Evaluation, Reference
from reports import DesignView, write_report

Machine = Callable[[Array], DesignView]


@pytest.fixture(scope="module")
def report(
    finished_run: RunDirectory, machine: Machine, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
    """HTML and PDF of the finished run."""
    folder = tmp_path_factory.mktemp("report")
    html, pdf = folder / "report.html", folder / "report.pdf"
    write_report(finished_run, describe=machine, html=html, pdf=pdf)
    return html, pdf


def words(path: Path) -> str:
    """Text of a page without its tags, styles and scripts."""
    text = re.sub(r"<(script|style).*?</\1>", "", path.read_text(encoding="utf-8"), flags=re.S)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text))


def squeezed(text: str) -> str:
    """Text without its spaces, which a page sets as it likes."""
    return re.sub(r"[\s\u200b]+", "", text)


def test_html_is_self_contained(report: tuple[Path, Path]) -> None:
    html = report[0].read_text(encoding="utf-8")
    sources = re.findall(r"""(?:src|href)=["']([^"']*)""", html)
    assert len(sources) > 8
    assert all(source.startswith("data:") for source in sources)
    assert not re.search(r"url\(|@import", html)
    assert all(alt.strip() for alt in re.findall(r'<img[^>]*alt="([^"]*)"', html))
    assert html.count("<img") == len(re.findall(r'<img[^>]*alt="', html))


def test_html_says_what_was_asked(report: tuple[Path, Path]) -> None:
    text = words(report[0])
    for phrase in (
        "fresh seeds", "below the baseline", "filling time", "physical lower bound",
        "93.8 %", "Best solutions", "Work and CPU time", "energy grew past 10 J",
        "y1 and y2 exchanged", "2023.02a", "1001, 1002", "not developable",
        "typical of generation 1", "repeated on longdouble 2022.01a",
    ):  # fmt: skip
        assert phrase in text, phrase
    assert "has not ended" not in text


def test_nothing_is_left_beside_the_reports(report: tuple[Path, Path]) -> None:
    assert sorted(p.name for p in report[0].parent.iterdir()) == ["report.html", "report.pdf"]


def test_pdf_has_the_same_words_on_numbered_pages(report: tuple[Path, Path]) -> None:
    from pypdf import PdfReader

    pages = [page.extract_text() for page in PdfReader(report[1]).pages]
    assert 5 <= len(pages) <= 9
    for number, page in enumerate(pages, start=1):
        assert f"{number} / {len(pages)}" in page
    text = squeezed(" ".join(re.sub(r"\d+ / \d+\s*$", "", page) for page in pages))
    assert "(dispersion)[ms]" in text  # figures are drawings with text, not photographs
    _, body = report[0].read_text(encoding="utf-8").split("<body>")
    body = re.sub(r'<script.*?</script>|<p class="hint">.*?</p>', "", body, flags=re.S)
    body = body.replace(" Choose one to turn it above.", "")
    for kind, mark in (("Table", '<p class="caption">'), ("Figure", "<figcaption>")):
        number = itertools.count(1)
        body = re.sub(mark, lambda m, k=kind, n=number: f"{m[0]}{k} {next(n)}. ", body)
    pieces = [squeezed(unescape(piece)) for piece in re.findall(r">([^<>]+)<", body)]
    assert len(pieces) > 300
    assert [piece for piece in pieces if piece not in text] == []
    headings = [squeezed(heading) for heading in re.findall(r"<h2>(.*?)</h2>", body)]
    assert len(headings) >= 8
    assert sorted(headings, key=text.index) == headings


def test_pdf_takes_the_words_of_a_study_literally(
    make_run: Callable[..., RunDirectory], machine: Machine, tmp_path: Path
) -> None:
    from pypdf import PdfReader

    run = make_run(generations=1, finished=False)
    odd = '#panic() $x$ *b* _i_ @see <l> `r` [c] // ~ \\ "q" -- ' + "long" * 40
    run.header = {**run.header, "study": odd}
    run.study_file.write_text(odd, encoding="utf-8")
    write_report(run, describe=machine, html=tmp_path / "r.html", pdf=tmp_path / "r.pdf")
    reader = PdfReader(tmp_path / "r.pdf")
    text = squeezed(" ".join(page.extract_text() for page in reader.pages))
    assert text.count(squeezed(odd)) == 2
    assert reader.metadata is not None
    assert reader.metadata.title == f"{odd}: optimisation report"


def test_broken_off_run_shows_what_there_is(
    make_run: Callable[..., RunDirectory], machine: Machine, tmp_path: Path
) -> None:
    html, pdf = tmp_path / "r.html", tmp_path / "r.pdf"
    write_report(make_run(generations=3, finished=False), describe=machine, html=html, pdf=pdf)
    text = words(html)
    assert "This run has not ended" in text
    assert "72 runs made so far" in text
    assert "fresh seeds have not confirmed it" in text
    assert "Progress of the search" in text
    assert pdf.read_bytes().startswith(b"%PDF")


def test_a_reference_run_that_is_left_out_is_told_with_the_remedy(
    make_run: Callable[..., RunDirectory], machine: Machine, tmp_path: Path
) -> None:
    run = make_run(generations=3, finished=False)
    run.add_reference(Reference(why_not="yade is not installed; install it"))
    write_report(run, describe=machine, html=tmp_path / "r.html")
    text = words(tmp_path / "r.html")
    assert "The reference run is skipped: yade is not installed; install it." in text
    assert "on the reference engine" not in text


def test_empty_run(make_run: Callable[..., RunDirectory], machine: Machine, tmp_path: Path) -> None:
    html, pdf = tmp_path / "r.html", tmp_path / "r.pdf"
    write_report(make_run(generations=0, finished=False), describe=machine, html=html, pdf=pdf)
    text = words(html)
    assert "Nothing has run yet" in text
    assert "Versions and seeds" in text
    assert "Progress of the search" not in text
    assert pdf.read_bytes().startswith(b"%PDF")


def test_user_problem_leaves_out_what_does_not_apply(own_run: RunDirectory, tmp_path: Path) -> None:
    html = tmp_path / "r.html"
    write_report(own_run, html=html)
    text = words(html)
    assert "objective value" in text
    assert "pressure" in text
    for phrase in ("filling time", "Motion of the cup", "Shapes", "grains left", "nan"):
        assert phrase not in text


def test_names_of_the_study_cannot_break_the_page(
    make_run: Callable[..., RunDirectory], tmp_path: Path
) -> None:
    run = make_run(generations=0, finished=False)
    run.header = {**run.header, "study": "<script>alert(1)</script>"}
    write_report(run, html=tmp_path / "r.html")
    assert "<script>alert" not in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_an_own_problem_has_no_spheres_and_the_objective_is_named_once(
    own_run: RunDirectory, finished_run: RunDirectory, tmp_path: Path
) -> None:
    write_report(own_run, html=tmp_path / "own.html")
    own = words(tmp_path / "own.html")
    assert "sphere-steps" not in own
    assert "to minimise the objective value" in own
    write_report(finished_run, html=tmp_path / "r.html")
    text = words(tmp_path / "r.html")
    assert "work [sphere-steps]" in text
    assert "objective, objective" not in text


def test_the_check_before_the_search_is_no_run_on_a_fresh_seed(
    make_run: Callable[..., RunDirectory], machine: Machine, tmp_path: Path
) -> None:
    run, html = make_run(generations=3, finished=False), tmp_path / "r.html"
    *_, last = run.evaluations()
    index = last.candidate.index + 1
    check = replace(last.candidate, index=index, purpose="check", generation=0)
    run.add_evaluation(Evaluation(check, last.outcome, last.objective))
    write_report(run, describe=machine, html=html)
    assert "<dt>fresh seeds</dt>" not in html.read_text(encoding="utf-8")
