"""The material file: from a calibration to a study that takes it, or refuses it with the reason."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from fidelity.level import SceneLevel
from mfopt.commands.app import app
from mfopt.records.calibration import Found, Summary
from mfopt.study.assemble import assemble
from mfopt.study.calibrated import calibrated_material
from mfopt.study.case import AssembledCase, assemble_case
from mfopt.study.material import read_with_material
from mfopt.study.material_file import material_of_tables, material_text, read_material

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "calibration"
STUDY = """
material = "material.toml"
[study]
name = "beads"
[problem]
scene = "discharge"
objective = "discharge_time"
[problem.discharge]
portion_kg = 0.25
floor_mm = 4
duration_ms = 600
[problem.discharge.free]
opening = [25, 60]
[[level]]
name = "coarse"
engine = "numba"
grains = 25
contact_law = "hertz"
damping = 0
young_modulus_pa = 1e6
[[level]]
name = "target"
engine = "numba"
grains = 57
contact_law = "hertz"
damping = 0
young_modulus_pa = 2e6
[search]
budget = 1
[confirm]
seeds = 0
"""
COARSE = 'scene = "discharge"\ncoarse = 3\n'  # 57 grains instead of 1528


def found(name: str, value: float, *, asked: bool = True, determined: bool = True) -> Found:
    low, high = 0.8 * value, 1.2 * value
    return Found(
        name,
        "-",
        low / 2,
        2 * high,
        value,
        value,
        (low, high),
        0.2,
        determined,
        asked=asked,
        log=False,
        edge=None,
    )


FRICTION = found("friction", 0.36412345)
BOUNCE = found("restitution", 0.6, determined=False)
STIFFNESS = found("young_modulus", 2e6, asked=False)


def summary(*parameters: Found) -> Summary:
    return Summary(
        "glass-beads", parameters, directions=(), combinations=[], trade_offs=[],
        correlation=[], draws=[],
        log_evidence=0.0, misfit=9.0, freedom=9, probability=0.4, fits=True, recordings=(),
        compared=(), noise=(), runs=200, failed=0, cpu_s=1.0, emulators=(), without=(), advice=(),
        further=[], warnings=[], check=[], words=[],
    )  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beads")
    for file in (EXAMPLES / "beads").glob("*.*"):
        (folder / file.name).write_text(
            file.read_text().replace('scene = "discharge"\n', COARSE, 1)
        )
    return folder / "case.toml"


@pytest.fixture(scope="module")
def parts(case: Path) -> AssembledCase:
    return assemble_case(case)


@pytest.fixture(scope="module")
def text(parts: AssembledCase) -> str:
    material = calibrated_material(summary(FRICTION, BOUNCE, STIFFNESS), parts)
    assert material is not None
    return material_text(material)


def written(folder: Path, material: str, study: str = STUDY) -> Path:
    (folder / "material.toml").write_text(material)
    (folder / "study.toml").write_text(study)
    return folder / "study.toml"


def mfopt(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def refused(study: Path) -> str:
    done = mfopt("check", study)
    assert done.exit_code == 2, done.output
    assert done.stderr.count("error:") == 1
    return done.stderr


def test_the_file_says_what_was_found_and_what_it_holds_for(tmp_path: Path, text: str) -> None:
    written(tmp_path, text)
    its = read_material(tmp_path / "material.toml")
    assert material_text(its) == text
    assert its.case == "glass-beads"
    assert its.recordings == ["slot 30 mm", "partial fill"]
    assert list(its.values) == ["friction", "restitution"]
    assert its.values["friction"].value == pytest.approx(FRICTION.mean, rel=1e-5)
    assert [v.determined for v in its.values.values()] == [True, False]
    held = its.holds_for
    assert (held.contact_law, held.engine, held.coarse) == ("hertz", "numba", 3.0)
    # Single spheres of 3 x 5 mm; walls are rougher than grains, so the grains' friction counts.
    assert held.grain_length_mm == held.grain_width_mm == pytest.approx(15.0, rel=0.01)
    assert held.wall_friction == held.friction
    # The stiffness was fitted along: 1.6e6 to 2.4e6, narrower than the factor of 2 that is allowed.
    assert held.young_modulus_pa == (1e6, 4e6)


def test_a_study_takes_the_values_on_all_levels(tmp_path: Path, text: str) -> None:
    study, _, taken = read_with_material(written(tmp_path, text))
    parts = assemble(study, where="study")
    assert taken is not None
    for level in parts.ladder:
        assert isinstance(level, SceneLevel)
        portion = level.scene.portion(parts.problem.baseline, level.dem)
        assert portion.physics.restitution == 0.6
        assert portion.grain_material.friction_angle == pytest.approx(math.atan(0.364123))
    done = mfopt("check", tmp_path / "study.toml")
    assert done.exit_code == 0, done.output
    assert "material.toml, calibration glass-beads: friction = 0.364123" in done.output
    assert "warning: restitution = 0.6 was not determined" in done.output
    assert "warning: friction" not in done.output


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"hertz"\ndamping = 0\nyoung_modulus_pa = 1e6', '"linear"\ndamping = 0',
         "level 'coarse': contact_law is linear, and the material's hertz"),
        ("damping = 0\nyoung_modulus_pa = 2e6", "young_modulus_pa = 2e6",
         "level 'target': damping is 0.125, and the material's 0"),
        ("young_modulus_pa = 2e6", "young_modulus_pa = 5e6",
         "young_modulus_pa is 5e+06, and must be from 1e+06 to 4e+06"),
        ("young_modulus_pa = 2e6", "young_modulus_pa = 2e6\neffects = {cohesion = {energy = 0.1}}",
         "effects.cohesion is { energy = 0.1 }, and the material's none"),
        ("grains = 57", "grains = 120", "(grains = 57 makes them alike)"),
        ("floor_mm = 4", "floor_mm = 4\nsize_scatter = 0.2",
         "size_scatter is 0.2, and the material's 0"),
        ("floor_mm = 4", "floor_mm = 4\nwall_friction_angle_deg = 10",
         "wall_friction is 0.176 (10 degrees), and the material's 0.364 (20 degrees)"),
        ("floor_mm = 4", "floor_mm = 4\ngrain_length_mm = 10",
         "spheres_per_grain is 5, and the material's 1"),
        ("floor_mm = 4", "floor_mm = 4\ngrain_length_mm = 10",
         "length over width is 2, and the material's 1"),
        ("floor_mm = 4", "floor_mm = 4\ngrain = {young_modulus_pa = 5e6, poisson_ratio = 0.25, "
         "density_kg_m3 = 1500}", "density_kg_m3 is 1500, and the material's 2500"),
        ("grains = 57", "grains = 57\nrestitution = 0.6",
         "restitution of level 'target' (restitution), and so does material material.toml"),
        ("floor_mm = 4", "floor_mm = 4\ngrain = {young_modulus_pa = 5e6, poisson_ratio = 0.25, "
         "density_kg_m3 = 2500, friction_angle_deg = 20}",
         "problem.discharge.grain.friction_angle_deg (friction)"),
        ('engine = "numba"', 'engine = "command"\ncommand = ["true"]', "grains"),
        ('"material.toml"', '"other.toml"', "other.toml does not exist; `mfopt calibrate` writes"),
        ('"material.toml"', '"."', "is a directory"),
        ('"material.toml"', "3", "material = 3"),
        ('"material.toml"', '"a\\u0000b"', "zero byte"),
        ("floor_mm = 4", "floor_mm = 4\ngrain = 3", "must be tables"),
        ('scene = "discharge"', 'scene = "dicharge"', "did you mean 'discharge'"),
        ('scene = "discharge"', "", "material needs a scene"),
    ],
)  # fmt: skip
def test_a_study_that_disagrees_is_refused(
    tmp_path: Path, text: str, old: str, new: str, said: str
) -> None:
    assert old in STUDY
    assert said in refused(written(tmp_path, text, STUDY.replace(old, new)))


def test_all_disagreements_are_named_at_once(tmp_path: Path, text: str) -> None:
    study = STUDY.replace('contact_law = "hertz"\ndamping = 0\n', "").replace("57", "120")
    said = refused(written(tmp_path, text, study))
    assert said.count("contact_law is linear") == said.count("damping is 0.125") == 2
    assert "a simulated grain is 11.7 mm long, and the material's 15 mm" in said
    assert "[rig.level]" in said


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("grains = 57", "grains = 60", None),  # 2 % smaller
        ("grains = 25", "grains = 20", None),  # coarse levels may have any grains
        ("damping = 0\n", "damping = 0\ndamp_gravity = true\n", None),  # nothing to damp
        ('"target"\nengine = "numba"', '"target"\nengine = ["bullet", "numba"]', None),
        ('"target"\nengine = "numba"', '"target"\nengine = ["yade", "bullet"]',
         "calibrated on numba"),
    ],
)  # fmt: skip
def test_what_makes_no_difference_is_taken(
    tmp_path: Path, text: str, old: str, new: str, said: str | None
) -> None:
    assert old in STUDY
    _, _, taken = read_with_material(written(tmp_path, text, STUDY.replace(old, new)))
    assert taken is not None
    assert (said or "") in " ".join(taken.words)
    assert len(taken.warnings) == 1 + (said is not None)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fits = true", "fits = false", "does not fit the recordings of glass-beads"),
        ("fits = true", "fits = 1", "fits = 1"),
        ("fits = true", "# fits", "'fits' is missing"),
        ("value = 0.364123", "value = nan", "values.friction.value = nan must be a finite number"),
        ("value = 0.364123", 'value = "0.36"', "values.friction.value = '0.36'"),
        ("value = 0.364123", "value = -0.1", "friction = -0.1 must be at least 0"),
        ("value = 0.6", "value = 1.5", "restitution = 1.5 must be at most 1"),
        ("low = ", "lowest = ", "unknown key 'values.friction.lowest'"),
        ("[values.friction]", "[values.fricton]", "did you mean 'friction'"),
        ("[values.friction]", "[values.rolling_resistance]", 'values."rolling_resistance.coeff'),
        ("[values.friction]\nvalue = 0.364123", '[values."drag_linear.rate"]\nvalue = 1e9',
         "values: effect 'drag_linear': rate = 1e+09 1/s must be at most"),
        ("density_kg_m3 = 2500.0\n", "", "'holds_for.density_kg_m3' is missing"),
        ("[1000000.0, 4000000.0]", "[4e6, 1e6]", "from a smaller to a larger value; swap them"),
        ("[1000000.0, 4000000.0]", "[1e6]", "holds_for.young_modulus_pa"),
        ("grain_width_mm = 1", "grain_width_mm = 2", "exchange them"),
        ("format = 1", "format = 2", "format = 2"),
        ("[holds_for]", "[holds_for", "is not valid TOML"),
        ("low = 0.291299", "low = 0.9", "low = 0.9 must be at most high = 0.436948; swap them"),
    ],
)  # fmt: skip
def test_a_bad_file_is_refused(tmp_path: Path, text: str, old: str, new: str, said: str) -> None:
    assert old in text
    assert said in refused(written(tmp_path, text.replace(old, new)))


def test_values_of_effects_and_walls_are_set(tmp_path: Path, parts: AssembledCase) -> None:
    values = {
        "rolling_resistance": 0.1, "damping": 0.2, "wall_friction": 0.3, "young_modulus": 5e6,
    }  # fmt: skip
    its = material_with(parts, *(found(name, value) for name, value in values.items()))
    study = STUDY.replace("damping = 0\nyoung_modulus_pa = 1e6\n", "restitution = 0.7\n").replace(
        "damping = 0\nyoung_modulus_pa = 2e6\n", "restitution = 0.7\n"
    )
    made, _, _ = read_with_material(written(tmp_path, its, study))
    for level in assemble(made, where="study").ladder:
        assert isinstance(level, SceneLevel)
        assert level.dem.effects == {"rolling_resistance": {"coefficient": 0.1}}
        assert (level.dem.damping, level.dem.young_modulus_pa) == (0.2, 5e6)
        settings = level.scene.settings.model_dump()
        assert settings["wall_friction_angle_deg"] == pytest.approx(16.699, abs=1e-3)
    said = refused(written(tmp_path, its, STUDY))
    assert "young_modulus_pa of level 'target' (young_modulus)" in said
    assert "damping of level 'coarse' (damping)" in said


DOSING = """
material = "material.toml"
[study]
name = "rice"
[problem]
scene = "dosing"
objective = "dispersion"
[problem.dosing]
grain_length_mm = 5
grain_width_mm = 5
grain = { young_modulus_pa = 5e6, poisson_ratio = 0.25, density_kg_m3 = 2500 }
[[level]]
name = "target"
engine = "numba"
grains = 226
contact_law = "hertz"
damping = 0
young_modulus_pa = 2e6
[search]
budget = 1
"""


@pytest.mark.parametrize("coefficient", [0.3, 0.5])  # less than between grains, and more
def test_a_study_of_dosing_takes_the_friction_on_walls(
    tmp_path: Path, parts: AssembledCase, coefficient: float
) -> None:
    its = material_with(parts, FRICTION, BOUNCE, found("wall_friction", coefficient))
    made, _, _ = read_with_material(written(tmp_path, its, DOSING))
    angle = made.problem.others["dosing"]["wall_friction_angle_deg"]
    assert math.tan(math.radians(angle)) == pytest.approx(coefficient)
    study = DOSING.replace("[[level]]", "wall_friction_angle_deg = 20\n[[level]]", 1)
    said = refused(written(tmp_path, its, study))
    assert "problem.dosing.wall_friction_angle_deg (wall_friction)" in said


def material_with(parts: AssembledCase, *parameters: Found) -> str:
    """Text of the material of a case that had these parameters."""
    names = tuple(p.name for p in parameters)
    levels = tuple(replace(level, parameters=names) for level in parts.ladder)  # type: ignore[type-var]
    its = replace(parts, ladder=replace(parts.ladder, levels=levels))
    material = calibrated_material(summary(*parameters), its)
    assert material is not None
    return material_text(material)


def test_a_machine_is_no_material(parts: AssembledCase) -> None:
    text = material_with(parts, FRICTION, BOUNCE, found("tilt.angle", 0.02))
    assert "tilt" not in text


def test_a_doubtful_fit_is_written_and_said(parts: AssembledCase) -> None:
    its = replace(summary(FRICTION, BOUNCE, STIFFNESS), probability=0.001, fits=False)
    material = calibrated_material(its, parts)
    assert material is not None
    assert not material.fits


def test_a_program_of_the_user_has_no_material() -> None:
    balls = assemble_case(EXAMPLES / "balls" / "case.toml")
    assert calibrated_material(summary(found("restitution", 0.6)), balls) is None


def test_recordings_of_different_grains_give_no_material(case: Path, tmp_path: Path) -> None:
    for file in case.parent.glob("*.*"):
        text = file.read_text().replace("portion_kg = 0.12", "grain_width_mm = 4")
        (tmp_path / file.name).write_text(text)
    parts = assemble_case(tmp_path / "case.toml")
    assert calibrated_material(summary(FRICTION, BOUNCE, STIFFNESS), parts) is None


def test_a_run_resumes_with_its_material_only_and_names_it(tmp_path: Path, text: str) -> None:
    study, run = written(tmp_path, text), tmp_path / "run"
    done = mfopt("run", study, "-d", run)
    assert done.exit_code == 0, done.output
    assert "material.toml, calibration glass-beads" in done.output
    assert "<dt>material</dt><dd>material.toml, calibration" in (run / "report.html").read_text()
    assert mfopt("run", study, "-d", run, "--resume").exit_code == 0

    (tmp_path / "material.toml").write_text(text.replace("value = 0.6\n", "value = 0.6005\n"))
    done = mfopt("run", study, "-d", run, "--resume")
    assert done.exit_code == 2, done.output
    assert "settings material values restitution value 0.6 (now 0.6005)" in done.output

    (tmp_path / "material.toml").unlink()  # the run directory holds all that a report needs
    assert mfopt("report", run).exit_code == 0


def test_the_example_takes_the_material_of_its_case(tmp_path: Path) -> None:
    beads = EXAMPLES / "beads"
    material = calibrated_material(
        summary(FRICTION, BOUNCE, STIFFNESS), assemble_case(beads / "case.toml")
    )
    assert material is not None
    folder, run = tmp_path / "examples" / "calibration" / "beads", tmp_path / "runs" / "glass-beads"
    folder.mkdir(parents=True)
    run.mkdir(parents=True)
    (folder / "hopper.toml").write_text((beads / "hopper.toml").read_text())
    (run / "material.toml").write_text(material_text(material))
    done = mfopt("check", folder / "hopper.toml")
    assert done.exit_code == 0, done.output
    assert "calibration glass-beads: friction = 0.364123" in done.output


def test_tables_of_a_run_are_a_material(text: str, tmp_path: Path) -> None:
    written(tmp_path, text)
    its = read_material(tmp_path / "material.toml")
    again = material_of_tables(its.model_dump(mode="json"), where="run.json")
    assert again == its
