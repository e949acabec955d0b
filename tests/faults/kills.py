"""Kills at random moments: of mfopt, a worker, the keeper of a simulator, a simulator."""

import contextlib
import os
import random
import shutil
import signal
import time
from pathlib import Path

from faults.campaign import (
    GRACE_S,
    SIMULATOR,
    TIME_LIMIT_S,
    Campaign,
    End,
    Ended,
    complaint,
    new_campaign,
    resumes,
)  # fmt: skip
from faults.table import Trial

TARGETS = ("mfopt", "worker", "keeper", "simulator")
TRIES = 20  # moments looked for until one finds what is to be killed


def trial(folder: Path, study: str, wanted: End, seed: int, number: int) -> Trial:
    """Kill once, let the run end or resume it, and compare with an undisturbed end."""
    target = TARGETS[number % len(TARGETS)]
    choose = random.Random(f"kill {seed} {number}")
    for _ in range(TRIES):
        campaign = new_campaign(folder, study)
        lines = choose.randint(0, len(wanted) + 2)
        delay_s = choose.uniform(0.0, 0.4)
        case = f"{target} {delay_s:.2f} s after line {lines} (seed {seed}, number {number})"
        killed, ended, kept = _run_and_kill(campaign, target, lines, delay_s, choose)
        if killed:
            loss = _loss(campaign, target, ended, kept, wanted)
            if loss is None:
                shutil.rmtree(folder)
            return Trial(f"kill of {target}", case, loss)
    return Trial(f"kill of {target}", case, f"found none to kill at {TRIES} moments")


def _run_and_kill(
    campaign: Campaign, target: str, lines: int, delay_s: float, choose: random.Random
) -> tuple[bool, Ended, list[bytes]]:
    """Run; kill `target` once, so long after the journal has so many lines."""
    killed, kept = False, list[bytes]()
    with campaign.start() as process:
        while process.poll() is None and len(campaign.journal()) < lines:
            time.sleep(0.005)
        time.sleep(delay_s)
        while process.poll() is None and not killed:
            living = [process.pid] if target == "mfopt" else _found(campaign, target)
            with contextlib.suppress(ProcessLookupError, IndexError):  # ended by itself, or none
                os.kill(choose.choice(living), signal.SIGKILL)
                killed = True
        kept = campaign.journal()
        output, errors = process.communicate(timeout=TIME_LIMIT_S)
    return killed, Ended(process.returncode, output, errors), kept


def _found(campaign: Campaign, target: str) -> list[int]:
    """Processes of a kind, told by their command lines."""
    return [pid for pid, words in campaign.processes().items() if _kind(words) == target]


def _kind(words: list[bytes]) -> str:
    if b"--multiprocessing-fork" in words:
        return "worker"
    if any(word.endswith(b"supervise.py") for word in words):
        return "keeper"
    simulators = (str(SIMULATOR).encode(), b"/yade")
    if words and any(word.endswith(simulators) for word in words[:4]):
        return "simulator"
    return "other"


def _loss(
    campaign: Campaign, target: str, ended: Ended, kept: list[bytes], wanted: End
) -> str | None:
    if (orphans := _orphans(campaign)) is not None:
        return orphans
    if target != "mfopt" and (wrong := complaint(ended, codes=(0,))) is not None:
        return wrong
    if (wrong := resumes(campaign, wanted)) is not None:
        return wrong
    if campaign.journal()[: len(kept)] != kept:
        return "lines of the journal are lost"
    return None


def _orphans(campaign: Campaign) -> str | None:
    """What is left running of a run that has ended; killed here, after the grace."""
    began = time.monotonic()
    while living := campaign.processes():
        if time.monotonic() - began > GRACE_S:
            for pid in living:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            return f"orphans: {[b' '.join(words)[-200:] for words in living.values()]}"
        time.sleep(0.02)
    return None
