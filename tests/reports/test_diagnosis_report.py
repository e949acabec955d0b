"""The report of a diagnosis holds what was found, whatever was said; damage is refused."""

from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from calibrations import calibration
from pypdf import PdfReader
from test_write import squeezed, words

from calibration.diagnosis.words import in_words
from mfopt.errors import ConfigError
from mfopt.records.diagnosis import (
    FILE,
    BaseParameter,
    Beside,
    Consequence,
    Diagnosis,
    HeldOut,
    Next,
    Place,
    Rerun,
    Suspected,
    Value,
    Vote,
    as_json,
    read_diagnosis,
)
from reports.diagnosis import charts, write_diagnosis_report

TIMES = np.linspace(0.0, 2.0, 40)


def suspected(name: str, probability: float, *, measuring: bool = False) -> Suspected:
    return Suspected(
        name,
        measuring,
        f"meaning of {name}",
        "s",
        probability,
        0.31,
        (0.22, 0.4),
        12.5,
        ("clock_rate",) if probability > 0.5 else (),
        probability < 0.01,
        False,
    )


def place(recording: str, start: float, *, stands_out: bool) -> Place:
    return Place(
        recording,
        "level_left",
        "m",
        start,
        start + 0.25,
        0.1,
        0.14,
        3.2 if stands_out else 0.4,
        -0.004,
        0.002 if stands_out else 0.7,
        stands_out,
    )


def beside(recording: str, *, held_out: bool) -> Beside:
    level = 0.2 * np.exp(-TIMES)
    return Beside(
        recording,
        held_out,
        "level_left",
        "m",
        TIMES.tolist(),
        level.tolist(),
        (level + 0.01).tolist(),
        (level + 0.001).tolist(),
        (0.0 * level + 0.002).tolist(),
    )


def diagnosis(**changed: object) -> Diagnosis:
    made = Diagnosis(
        name="rig of two halves", kind="named", effects=("slow_gate",), probability=0.93, why="",
        explained=None, likeliest="slow_gate",
        mismatch=0.0004, gain=31.0, gain_at_5=3.3, unexplained=0.41, rest=0.38, nothing=0.01,
        other=0.04,
        suspects=(suspected("slow_gate", 0.93), suspected("clock_rate", 0.05, measuring=True),
                  suspected("tilt", 0.001)),
        parameters=(BaseParameter("friction", "-", 0.52, 0.44),),
        model=(Value("friction", "-", 0.44, (0.4, 0.48), True),),
        places=tuple(place(r, t, stands_out=t < 0.5) for r in ("wide", "narrow")
                     for t in (0.0, 0.25, 0.5, 0.75)),
        votes=(Vote("slow_gate", "wide", 14.2, False), Vote("slow_gate", "narrow", -5.0, True)),
        beside=(beside("wide", held_out=False), beside("between", held_out=True)),
        held_out=(HeldOut("between", 4.1, (3.9, 4.4), 1.07, (0.98, 1.3), 2.6, "clock_rate", 3.7),),
        next=(Next("opening_mm = 50", ("level_left", "level_right"), 6.1,
                   ("slow_gate", "clock_rate")),),
        consequence=None, library_runs=720, runs=32, failed=3, cpu_s=1800.0, words=[],
    )  # fmt: skip
    made = replace(made, **changed)  # type: ignore[arg-type]
    return replace(made, words=in_words(made))


def written(folder: Path, its: Diagnosis) -> tuple[str, str]:
    """Words of the HTML and the PDF."""
    run = calibration(folder / "run")
    (run.path / FILE).write_text(as_json(its))
    html, pdf = folder / "report.html", folder / "report.pdf"
    write_diagnosis_report(run, html=html, pdf=pdf)
    printed = "".join(page.extract_text() for page in PdfReader(pdf).pages)
    return squeezed(unescape(words(html))), squeezed(printed)


SAID = (
    "rig of two halves", "Simulation and recordings differ", "probability below 0.001",
    "What is missing: slow_gate = 0.31 s (90 % 0.22 to 0.4): meaning of slow_gate; probability",
    "these recordings hardly tell it from clock_rate", "narrow speaks against slow_gate",
    "recorded 0.004 m lower than simulated", "error 4.10 before, 1.07 with slow_gate",
    "4.10 to 1.07", "opening_mm = 50", "level left, level right", "slow gate from clock rate",
    "too weak to be seen", "camera or sensor", "0.440", "752 runs", "3 failed",
)  # fmt: skip


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    return written(tmp_path_factory.mktemp("diagnosis"), diagnosis())


@pytest.mark.parametrize("phrase", SAID)
def test_both_pages_say_what_was_found(pages: tuple[str, str], phrase: str) -> None:
    for page in pages:
        assert squeezed(phrase) in page


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"kind": "nothing", "effects": (), "mismatch": 0.4}, "Nothing is missing that these"),
        ({"kind": "set", "effects": ("slow_gate", "clock_rate"), "why": "they are alike"},
         "What is missing is slow_gate or clock_rate (93 % together): they are alike"),
        ({"kind": "unknown", "effects": (), "why": "every known effect leaves a part unexplained"},
         "What is missing is not known: every known effect leaves a part unexplained"),
        ({"held_out": (), "beside": (beside("wide", held_out=False),)}, "Hold one out"),
        ({"places": tuple(place("wide", t, stands_out=False) for t in (0.0, 0.25))},
         "No place stands out by itself"),
    ],
)  # fmt: skip
def test_whatever_was_said_has_its_words(
    tmp_path: Path, changed: dict[str, object], said: str
) -> None:
    for page in written(tmp_path, diagnosis(**changed)):
        assert squeezed(said) in page


def test_what_changes_for_a_study_is_said() -> None:
    designs = (Rerun(3, 0.1, 0.2), Rerun(7, 0.12, 0.15))
    its = diagnosis(consequence=Consequence("rice", "s", designs, -1.0, 3, 7, 0.05))
    assert "Design 7 is better than 3 now, by 0.05 s" in its.words
    same = diagnosis(consequence=Consequence("rice", "s", designs, 1.0, 3, 3, 0.0))
    assert "Design 3 remains the best of them" in same.words


def test_a_damaged_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(
        as_json(diagnosis()).replace('"mismatch": 0.0004', '"mismatch": "x"')
    )
    with pytest.raises(ConfigError, match="damaged at mismatch"):
        read_diagnosis(tmp_path)
    with pytest.raises(ConfigError, match="the diagnosis has not ended"):
        read_diagnosis(tmp_path / "elsewhere")


def test_a_wide_scale_of_places_has_plain_numbers() -> None:
    far = replace(place("wide", 0.0, stands_out=True), difference=45.0)
    drawing = charts.places([far, place("wide", 1.0, stands_out=False)])
    assert all(f">{mark}<" in drawing for mark in ("0.5", "1", "3", "10", "30"))
    assert "mathdefault" not in drawing
