"""The report of a calibration holds every parameter and recording, and refuses what is damaged."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from calibrations import calibration, draws, number, parameter, series, summary
from pypdf import PdfReader
from test_write import squeezed, words

from calibration.words import warnings
from mfopt.errors import ConfigError
from mfopt.records.calibration import FILE, Measured, Recorded, Summary
from reports.calibration import charts, tables, write_calibration_report
from reports.calibration.figures import best_fit_file
from reports.calibration.sentences import misfit, sentence, typeset
from reports.calibration.units import resolved


def written(folder: Path, its: Summary | None = None) -> tuple[str, PdfReader]:
    """Words of the HTML and the PDF."""
    run = calibration(folder / "run", its)
    html, pdf = folder / "run" / "report.html", folder / "run" / "report.pdf"
    write_calibration_report(run, html=html, pdf=pdf)
    return unescape(words(html)), PdfReader(pdf)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    text, pdf = written(tmp_path_factory.mktemp("calibration"))
    return text, squeezed("".join(page.extract_text() for page in pdf.pages))


SAID = (
    "The recordings determine friction = 0.370 (90 % interval 0.330 to 0.410).",
    "They do not determine restitution.", "The simulation fits the recordings.",
    "restitution is not determined: 0.35 to 0.90 has 90 % probability",
    "7.0\u00b710\u2075 to 5.0\u00b710\u2076", "Pa",
    "restitution \u2212 young_modulus", "young_modulus was fitted along", "probability 0.58",
    "slot 30 mm", "slot 40 mm", "opening_mm = 40, scene = discharge", "discharged fraction",
    "angle of repose", "held out", "a.csv: It had a gap.", "discharged fraction: 180, level: 177",
    "1.20 s", "Emulators and posterior took 41 CPU s.", "200 equally likely draws.",
    "from 3 repeats", "0.030 s", "0.00050 m",
    "the bottom fell out", "zero of level", "\u22120.0014 m", "spread over the ranges",
    "draws of the posterior", "Residuals",
    "What to record next", "To determine restitution, record next: a heap.", "31 %", "92 %",
    "Check of the emulators", "The emulators know their errors.", "left out", "1.60",
    "What each error does", "clock", "77", "0.330 to 0.410",
    "What the recordings leave possible", 'name = "invented"',
)  # fmt: skip


@pytest.mark.parametrize("phrase", SAID)
def test_both_pages_say_what_was_found(pages: tuple[str, str], phrase: str) -> None:
    text, printed = pages
    assert squeezed(phrase) in squeezed(text)
    assert squeezed(phrase) in printed


def test_html_is_self_contained_and_shows_every_figure(tmp_path: Path) -> None:
    written(tmp_path)
    html = (tmp_path / "run" / "report.html").read_text()
    assert len(re.findall(r'<img src="data:image/svg', html)) == 5  # 2 recordings, numbers, ...
    assert not re.search(r"url\(|@import", html)
    assert all(alt.strip() for alt in re.findall(r'<img[^>]*alt="([^"]*)"', html))


def test_pictures_of_the_best_fit_are_shown_where_there_are_some(tmp_path: Path) -> None:
    run = calibration(tmp_path / "run")
    square = '<svg xmlns="http://www.w3.org/2000/svg" width="90pt" height="90pt"></svg>'
    (run.path / best_fit_file(0)).write_text(square)
    (run.path / best_fit_file(1)).write_text(square)
    html, pdf = tmp_path / "r.html", tmp_path / "r.pdf"
    write_calibration_report(run, html=html, pdf=pdf)
    for name in ("slot 30 mm", "slot 40 mm"):
        assert f"under the conditions of the recording {name}" in words(html)
    printed = "".join(page.extract_text() for page in PdfReader(pdf).pages)
    assert printed.count("at work") == 2


def test_a_wrong_model_is_said_on_top_and_beside_the_values(tmp_path: Path) -> None:
    why = "The simulation does not fit: a misfit of 99 on 25 degrees of freedom"
    text, pdf = written(tmp_path, summary(fits=False, probability=1e-9, warnings=[why]))
    assert text.index("does not fit the recordings, so the values are") < text.index("friction =")
    assert text.index(why) < text.index("within the range")
    assert "In that model friction = 0.370" in text
    assert "The recordings determine" not in text
    assert "determined, of a wrong model" in text
    assert "probability below 0.001" in text
    assert squeezed(why) in squeezed("".join(page.extract_text() for page in pdf.pages))


def test_best_values_are_shown_of_determined_parameters_only(tmp_path: Path) -> None:
    known, lost = parameter("drag"), parameter("lift", determined=False, share=0.9)
    its = summary(parameters=(known, lost), correlation=np.eye(2).tolist(), draws=[[0.3, 0.4]] * 9)
    first, second = tables.parameters(its)
    assert (first.best, second.best) == ("0.360", "\u2013")
    assert second.best_place is None
    marked = [charts.posterior(of, np.array([[0.3], [0.4]]), np.eye(1)) for of in ([known], [lost])]
    assert [charts.ORANGE.lower() in svg.lower() for svg in marked] == [True, False]
    text, _ = written(tmp_path, its)
    assert "9 equally likely draws, 1 of them different" in text


def test_a_parameter_at_the_end_of_its_range_in_a_wrong_model_is_not_determined(
    tmp_path: Path,
) -> None:
    at_end = parameter("rate", determined=False, share=0.01, edge="upper")
    its = summary(parameters=(at_end,), correlation=[[1.0]], draws=[[0.35], [0.36], [0.37]],
                  fits=False, probability=1e-9)  # fmt: skip
    text, _ = written(tmp_path, its)
    assert "not determined: it lies at the upper end of its range" in text
    assert "not determined, at the upper end, of a wrong model" in text


def test_trade_offs_and_ends_of_ranges_are_shown(tmp_path: Path) -> None:
    its = summary(
        parameters=(parameter("drag", edge="upper"), *summary().parameters[1:]),
        trade_offs=["drag and lift trade off (correlation -0.95): 31 %"],
    )
    text, _ = written(tmp_path, its)
    assert squeezed("drag and lift trade off (correlation \u22120.95): 31 %.") in squeezed(text)
    assert "Some values hold only together" in text
    assert "determined, at the upper end" in text


def test_without_advice_and_check_there_are_no_such_parts(tmp_path: Path) -> None:
    text, _ = written(tmp_path, summary(advice=(), further=[], emulators=(), check=[]))
    assert "What to record next" not in text
    assert "Check of the emulators" not in text


@pytest.mark.parametrize("held_out", [False, True])
def test_numbers_alone_have_no_curves(tmp_path: Path, held_out: bool) -> None:
    only = (number("heap", "angle_of_repose", "rad", 0.4, held_out=held_out),)
    recordings = (Recorded("heap", held_out, {}, 2),)
    text, _ = written(tmp_path, summary(compared=only, recordings=recordings, noise=()))
    assert "The bar holds 90" in text
    assert "Residuals" not in text
    assert ("Prediction of what was held out" in text) is held_out


def test_many_parameters_channels_and_recordings_find_room(tmp_path: Path) -> None:
    parameters = tuple(parameter(f"effect_{i}.coefficient") for i in range(9))
    names = [f"recording {i} with a rather long name" for i in range(8)]
    channels = {name: ["channel_0"] for name in names}
    channels[names[0]] = [f"channel_{i}" for i in range(8)]
    its = summary(
        parameters=parameters,
        draws=draws(np.random.default_rng(1), parameters),
        correlation=np.eye(9).tolist(),
        recordings=tuple(Recorded(name, False, {}, 1) for name in names),
        compared=tuple(
            series(name, channel, "kg", 1e-4, held_out=False)
            for name in names for channel in channels[name]
        ),
    )  # fmt: skip
    text, pdf = written(tmp_path, its)
    assert "Only the first 7 of 9 parameters" in text
    assert all(len(page.extract_text()) > 40 for page in pdf.pages)


@pytest.mark.parametrize(("low", "high"), [(0.0017, 0.00305), (-2.0, 3.0), (4.0, 4.0 + 1e-9)])
def test_ticks_of_the_posterior_leave_room_at_the_ends(low: float, high: float) -> None:
    ticks = np.array(charts.inner_ticks(low, high, 3))
    assert len(ticks) >= 1
    assert np.all(ticks > low + 0.1 * (high - low))
    assert np.all(ticks < high - 0.1 * (high - low))


def test_names_of_users_are_text(tmp_path: Path) -> None:
    odd = "$\\foo$ #panic() <b>{{x}}\x07\u7c73"
    its = summary(name=odd, parameters=(parameter(odd),), correlation=[[1.0]],
                  draws=[[0.35], [0.36], [0.37]])  # fmt: skip
    named = replace(its.compared[0], channel=odd, recording=odd)
    recordings = (Recorded(odd, False, {odd: odd}, 1, 1.2, {odd: 40}),)
    its = replace(its, compared=(named,), recordings=recordings, notes=(odd,))
    text, _ = written(tmp_path, its)
    assert "$\\foo$ #panic() <b>{{x}}\\x07\u7c73 = 0.370" in text


def test_draws_that_are_all_equal_are_shown(tmp_path: Path) -> None:
    its = summary(parameters=(parameter("drag", interval=(0.36, 0.36)),), correlation=[[1.0]],
                  draws=[[0.36]] * 3)  # fmt: skip
    assert "drag = 0.370" in written(tmp_path, its)[0]


def test_a_missing_result_is_refused(tmp_path: Path) -> None:
    run = calibration(tmp_path / "run")
    (run.path / FILE).unlink()
    with pytest.raises(ConfigError, match=r"has not ended.*--resume"):
        write_calibration_report(run, html=tmp_path / "r.html")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda told: told[: len(told) // 2], "is damaged"),
        (lambda told: told.replace('"best": 0.36', '"best": "high"', 1), "parameters.0.best"),
        (lambda told: json.dumps({**json.loads(told), "draws": None}), "draws"),
        (lambda told: "[]", "is damaged"),
    ],
)  # fmt: skip
def test_a_damaged_result_is_refused(tmp_path: Path, change, said: str) -> None:  # type: ignore[no-untyped-def]
    run = calibration(tmp_path / "run")
    (run.path / FILE).write_text(change((run.path / FILE).read_text()))
    with pytest.raises(ConfigError, match=said):
        write_calibration_report(run, html=tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()


def test_values_have_the_digits_of_their_interval() -> None:
    assert resolved(0.123456, parameter("a", interval=(0.12, 0.125))) == "0.1235"
    assert resolved(12.3456, parameter("a", interval=(3.0, 20.0), high=30.0)) == "12"
    assert resolved(0.0456, parameter("a", "m", interval=(0.04, 0.05))) == "0.046"
    assert resolved(2.345e6, parameter("a", "Pa", high=1e7, log=True)) == "2.3\u00b710\u2076"


def test_values_axes_and_warnings_of_a_page_have_the_units_of_the_case(tmp_path: Path) -> None:
    swing = parameter("swing", "rad", high=1.5, edge="upper")
    its = summary(
        parameters=(swing,), correlation=[[1.0]], draws=[[0.35], [0.36], [0.37]],
        compared=(series("drum", "angle", "rad", 0.7, held_out=False),),
        recordings=(Recorded("drum", False, {}, 1),),
        noise=(Measured("angle", "rad", 5e-3, (4e-3, 6e-3), 0.03, "from 3 repeats"),),
    )  # fmt: skip
    its = replace(its, warnings=warnings(its))
    text, _ = written(tmp_path, its)
    assert "end of its range, 1.5 rad" in text
    assert squeezed("0.330 to 0.410 rad") in squeezed(text)
    assert squeezed("0.0050 rad") in squeezed(text)
    assert "\u00b0" not in text
    assert "angle [rad]" in charts.recording(its.compared, held_out=False)
    assert "swing [rad]" in charts.posterior(its.parameters, np.array(its.draws), np.eye(1))


def test_powers_of_ten_in_a_warning_are_typeset() -> None:
    assert typeset("1.2e+07 Pa, 3e-05 m, size2e, 1e6b") == (
        "1.2\u00b710\u2077 Pa, 3\u00b710\u207b\u2075 m, size2e, 1e6b."
    )


def test_sentences_name_only_what_there_is() -> None:
    none = summary(parameters=(parameter("a", determined=False),), compared=())
    assert sentence(none) == (
        "The recordings do not determine a. The simulation fits the recordings."
    )
    assert "on 1 degree of freedom" in misfit(summary(freedom=1))
