"""`mfopt calibrate` without a terminal: it says when the fit begins, and SIGTERM ends it well."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

BALLS = Path(__file__).resolve().parents[2] / "examples" / "calibration" / "balls"


def test_the_fit_is_said_and_sigterm_ends_it_as_ctrl_c_does(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mfopt", "calibrate", str(BALLS / "case.toml"), "-d", "run"]
    with subprocess.Popen(
        [*command, "--workers", "2"], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "TERM": "dumb"},
    ) as running:  # fmt: skip
        assert running.stdout is not None
        said = next(line for line in running.stdout if "simulations are made" in line)
        assert said.endswith("of 200 simulations are made; now the fit learns from them\n")
        time.sleep(0.1)
        running.send_signal(signal.SIGTERM)
        _, errors = running.communicate(timeout=60)
    assert running.returncode == 1
    assert errors == "error: interrupted; the run continues with --resume\n"
    assert (tmp_path / "run" / "journal.jsonl").read_text().count('"evaluation"') >= 94
