"""Two starts of one run directory at the same instant: exactly one goes on."""

import contextlib
import json
import multiprocessing
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Barrier
from pathlib import Path

from faults.campaign import (
    TIME_LIMIT_S,
    Campaign,
    End,
    Ended,
    complaint,
    difference,
    new_campaign,
)  # fmt: skip
from faults.table import Trial
from mfopt.errors import ConfigError
from mfopt.files.lock import held

# Everything loaded, it says so and waits for its standard input to be closed.
WAITING = """
import sys
from mfopt.__main__ import main
import mfopt.commands.app, mfopt.campaign.run
print("ready", flush=True)
sys.stdin.read()
main()
"""


def trial(folder: Path, study: str, wanted: End, seed: int, number: int) -> Trial:
    """Start two whole `mfopt run`, in turns of the same and of different studies."""
    choose = random.Random(f"starts {seed} {number}")
    campaign = new_campaign(folder, study)
    same = number % 2 == 0
    other = folder / "other.toml"
    other.write_text(study if same else study.replace("seed = 3", "seed = 4"))
    options = choose.choice([[], ["--resume"]])
    studies = [campaign.study, other]
    choose.shuffle(studies)
    ended = _both(campaign, studies, options)
    loss = _loss(campaign, studies, ended, wanted)
    if loss is None:
        shutil.rmtree(folder)
    kind = "the same study" if same else "different studies"
    return Trial("two whole starts", f"{kind} {options} (seed {seed}, number {number})", loss)


def _both(campaign: Campaign, studies: list[Path], options: list[str]) -> list[Ended]:
    receive, release = os.pipe()
    processes = []
    for study in studies:
        arguments = ["run", str(study), "-d", str(campaign.directory), "--quiet", *options]
        process = subprocess.Popen(
            [sys.executable, "-c", WAITING, *arguments],
            env=campaign.environment, text=True,
            stdin=receive, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        processes.append(process)
    os.close(receive)
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()
    os.close(release)
    ended = []
    for process in processes:
        output, errors = process.communicate(timeout=TIME_LIMIT_S)
        ended.append(Ended(process.returncode, output, errors))
    return ended


def _loss(campaign: Campaign, studies: list[Path], ended: list[Ended], wanted: End) -> str | None:
    for one in ended:
        if (wrong := complaint(one, codes=(0, 2))) is not None:
            return wrong
    codes = [one.returncode for one in ended]
    if sorted(codes) != [0, 2]:
        return f"exit codes {codes}"
    winner = studies[codes.index(0)]
    if (campaign.directory / "study.toml").read_text() != winner.read_text():
        return "the run directory holds the study of the one that was refused"
    kinds = [json.loads(line)["kind"] for line in campaign.journal()]
    if kinds.count("end") != 1:
        return f"{kinds.count('end')} ends in the journal"
    if kinds.count("evaluation") != len(wanted):
        return "evaluations are twice in the journal"
    if winner.read_text() == campaign.study.read_text():
        return difference(campaign.end(), wanted)
    return None


def lock_trials(folder: Path, rounds: int) -> Iterator[Trial]:
    """Let two processes take the lock of one directory at the same instant, `rounds` times."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(2)
    pipes, processes = [], []
    for _ in range(2):
        mine, its = context.Pipe()
        process = context.Process(target=_contend, args=(barrier, its, folder, rounds))
        process.start()
        its.close()
        pipes.append(mine)
        processes.append(process)
    for number in range(rounds):
        got = [pipe.recv() for pipe in pipes]
        loss = None if sorted(got) == ["held", "refused"] else f"{got}"
        yield Trial("two starts at the lock", f"round {number}", loss)
    for process in processes:
        process.join()


def _contend(barrier: Barrier, pipe: Connection, folder: Path, rounds: int) -> None:
    for number in range(rounds):
        path = folder / f"lock-{number % 10}"  # new in the first rounds, then there already
        with contextlib.ExitStack() as stack:
            barrier.wait()
            try:
                stack.enter_context(held(path))
                said = "held"
            except ConfigError:
                said = "refused"
            barrier.wait()  # both have tried
            pipe.send(said)
        barrier.wait()  # the lock is free again
