"""Cases of real recordings that a command works off; what has a result is not made again."""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.calibration.real.text import CaseText

Cases = Mapping[str, Callable[[Path], list[CaseText]]]


def chosen(
    description: str, cases: Cases, arguments: Sequence[str] | None
) -> Iterator[tuple[CaseText, Path]]:
    """The cases that the command line names, and where their results are kept."""
    parser = argparse.ArgumentParser(prog="real", description=description)
    parser.add_argument("what", choices=cases)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--only", nargs="*", help="names of cases, or parts of them")
    given = parser.parse_args(arguments)
    data = Path(os.environ.get("MFOPT_RECORDINGS", ""))
    if "MFOPT_RECORDINGS" not in os.environ or not data.is_dir():
        parser.error("set MFOPT_RECORDINGS to the folder of recordings")
    for case in cases[given.what](data.resolve()):
        if not given.only or any(part in case.name for part in given.only):
            yield case, given.work


def result(case: CaseText, folder: Path, command: str, file: str, *more: str) -> dict[str, Any]:
    """What a command of mfopt writes for a case, made if it is not there.

    Args:
        case: that is written to `folder`.
        folder: of the case and of its run.
        command: of mfopt.
        file: that the command writes to the run directory.
        more: options.
    """
    found = folder / "run" / file
    if not found.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in {**case.files, "case.toml": case.text}.items():
            (folder / name).write_text(text)
        line = [sys.executable, "-m", "mfopt", command, str(folder / "case.toml")]
        line += ["-d", str(found.parent), "--runs", str(case.runs), "--workers", "1", "--quiet"]
        if (found.parent / "run.json").exists():
            line.append("--resume")
        subprocess.run([*line, *more], check=True, stdout=subprocess.DEVNULL)
    return dict(json.loads(found.read_text()))
