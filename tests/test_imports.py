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
        if path.parent == ROOT / "mfopt" / "commands":
            continue  # the one place where everything meets
        others = {module.split(".")[0] for module in imported(path)} & set(FOLDERS)
        assert others <= ALLOWED[folder] | {folder}, path


def test_only_the_entry_imports_the_commands() -> None:
    commands, entry = ROOT / "mfopt" / "commands", ROOT / "mfopt" / "__main__.py"
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            if path != entry and path.parent != commands:
                assert not any(m.startswith("mfopt.commands") for m in imported(path)), path
