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


# Where everything meets.
MEETING = (ROOT / "mfopt" / "commands", ROOT / "mfopt" / "study")
FACE = ROOT / "mfopt" / "__init__.py"  # loads what a user asks for
# Each package imports only those before it.
FLOORS = {
    "mfopt": ("files", "records", "search", "campaign", "study", "commands"),
    "fidelity": ("dem", "programs", "engines", "grains", "effects", "scenes"),
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
        if path.parent in MEETING or path == FACE:
            continue
        others = {module.split(".")[0] for module in imported(path)} & set(FOLDERS)
        assert others <= ALLOWED[folder] | {folder}, path


@pytest.mark.parametrize(("folder", "floor"), [(f, p) for f in FLOORS for p in FLOORS[f]])
def test_packages_stand_on_those_below(folder: str, floor: str) -> None:
    above = FLOORS[folder][FLOORS[folder].index(floor) + 1 :]
    for path in sorted((ROOT / folder / floor).rglob("*.py")):
        if path.parent in MEETING:
            continue
        found = {m.split(".")[1] for m in imported(path) if m.startswith(f"{folder}.")}
        assert not found & set(above), path


def test_only_the_entry_imports_the_commands() -> None:
    commands, entry = ROOT / "mfopt" / "commands", ROOT / "mfopt" / "__main__.py"
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            if path != entry and path.parent != commands:
                assert not any(m.startswith("mfopt.commands") for m in imported(path)), path
