"""The wheel, unpacked elsewhere, works without the source tree."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("mfopt", "fidelity", "geometry", "surrogates", "calibration", "reports")


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The content of a wheel that is built from a copy of the sources."""
    source, built = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("built")
    for name in (*PACKAGES, "examples"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    build = f"from setuptools.build_meta import build_wheel; build_wheel({str(built)!r})"
    subprocess.run([sys.executable, "-c", build], cwd=source, capture_output=True, check=True)
    (wheel,) = built.glob("mfopt-*.whl")
    with zipfile.ZipFile(wheel) as content:
        content.extractall(built / "site")
    return built / "site"


def test_every_file_of_the_packages_is_in_the_wheel(unpacked: Path) -> None:
    ours = {
        path.relative_to(ROOT)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {path for path in ours if not (unpacked / path).is_file()} == set()


@pytest.mark.parametrize(("scene", "example"), [("dosing", "rice-quick"), ("discharge", "hopper")])
def test_its_templates_are_the_shipped_examples(scene: str, example: str, unpacked: Path) -> None:
    shipped = (ROOT / "examples" / f"{example}.toml").read_bytes()
    assert (unpacked / "fidelity" / "scenes" / scene / "template.toml").read_bytes() == shipped


def test_init_and_check_work_from_the_wheel(unpacked: Path, tmp_path: Path) -> None:
    def mfopt(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "mfopt", *arguments], cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(unpacked)},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert mfopt("--version").startswith("mfopt ")
    assert "wrote study.toml" in mfopt("init", "study.toml")
    assert "dem-2000" in mfopt("check", "study.toml")
    where = "import mfopt, fidelity; print(mfopt.__file__, fidelity.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", where], cwd=tmp_path, env={"PYTHONPATH": str(unpacked)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.count(str(unpacked)) == 2
