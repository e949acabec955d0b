"""The folders import each other only in the allowed directions."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("mfopt", "geometry", "fidelity", "surrogates", "calibration", "reports", "benchmarks")
ALLOWED = {
    "mfopt": set(),
    "geometry": {"mfopt"},
    "surrogates": {"mfopt"},
    "reports": {"mfopt"},
    "fidelity": {"mfopt", "geometry"},
    "calibration": {"mfopt", "surrogates"},
    "benchmarks": set(FOLDERS),
}


def imported(path: Path) -> set[str]:
    modules: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules.add(node.module or "")
    return modules


@pytest.mark.parametrize("folder", FOLDERS)
def test_imports_go_one_way(folder: str) -> None:
    for path in sorted((ROOT / folder).rglob("*.py")):
        if path == ROOT / "mfopt" / "cli.py":
            continue  # the one place where everything meets
        others = {module.split(".")[0] for module in imported(path)} & set(FOLDERS)
        assert others <= ALLOWED[folder] | {folder}, path


def test_nothing_imports_the_cli() -> None:
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            entry = path == ROOT / "mfopt" / "__main__.py"
            assert entry or "mfopt.cli" not in imported(path), path
