"""The n-th write fails, for every n: no space left, or an input/output error."""

import errno
import json
import os
import shutil
from pathlib import Path

from faults.campaign import (
    COMMANDS,
    Campaign,
    End,
    Ended,
    complaint,
    difference,
    new_campaign,
    resumes,
)
from faults.table import Trial

STUDY = COMMANDS.replace("workers = 2", "workers = 1")  # so that its writes can be counted
HOOK = Path(__file__).with_name("hook")
ERRORS = (errno.ENOSPC, errno.EIO)
Case = tuple[str, int, int]  # role, number of the write, errno


def counted(folder: Path) -> tuple[list[Case], End]:
    """Every write of an undisturbed run, with every error, and what that run came to."""
    campaign = new_campaign(folder, STUDY)
    if (wrong := complaint(_run(campaign, ("", 0, 0), folder / "told"), codes=(0,))) is not None:
        raise RuntimeError(f"undisturbed run: {wrong}")
    found: list[Case] = []
    for role in ("main", "worker"):
        writes = len((folder / f"told.{role}").read_text().splitlines())
        found += [(role, n, error) for n in range(1, writes + 1) for error in ERRORS]
    wanted = campaign.end()
    shutil.rmtree(folder)
    return found, wanted


def trial(folder: Path, wanted: End, case: Case, number: int) -> Trial:
    """Let one write fail; then the run must resume to the undisturbed end."""
    role, _, error = case
    campaign, told = new_campaign(folder, STUDY), folder / "told"
    ended = _run(campaign, case, told)
    failed = told.read_text().strip() if told.exists() else "nothing"
    loss = _loss(campaign, complaint(ended, codes=(0, 1, 2)), ended.returncode, wanted)
    name = f"write of {role}: {errno.errorcode[error]}" if told.exists() else "write not made"
    if loss is None:
        shutil.rmtree(folder)
    return Trial(name, f"{failed}, write {case[1]} (number {number})", loss)


def _loss(campaign: Campaign, wrong: str | None, code: int, wanted: End) -> str | None:
    if wrong is not None:
        return wrong
    if code == 0 and (wrong := difference(campaign.end(), wanted)) is not None:
        return f"went on, but {wrong}"
    kept = campaign.journal()
    if (wrong := resumes(campaign, wanted)) is not None:
        return wrong
    if campaign.journal()[: len(kept)] != kept:
        return "lines of the journal are lost"
    return None


def _run(campaign: Campaign, case: Case, told: Path) -> Ended:
    role, number, error = case
    fault = {"role": role, "number": number, "errno": error, "told": str(told)}
    paths = os.pathsep.join(filter(None, (str(HOOK), os.environ.get("PYTHONPATH"))))
    return campaign.run(MFOPT_FAULT=json.dumps(fault), PYTHONPATH=paths)
