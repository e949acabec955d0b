"""A run that is killed at any moment resumes to the evaluations of an undisturbed one."""

import contextlib
import os
import random
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from campaigns import ASSISTED, STUDY, Campaign

NewCampaign = Callable[..., Campaign]
MOMENTS = int(os.environ.get("MFOPT_KILLS", "2"))  # scripts/survive takes ten of each
GRACE_S = 10.0  # for the kernel and the keepers to end what was left

NEEDS_YADE = pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed")
Evaluations = list[tuple[object, ...]]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, packings: Path) -> Evaluations:
    path = tmp_path_factory.mktemp("undisturbed")
    (path / "study.toml").write_text(STUDY.format(engine='"yade"'))
    environment = {**os.environ, "XDG_CACHE_HOME": str(packings), "MFOPT_TEST_MARK": "undisturbed"}
    campaign = Campaign(path / "study.toml", path / "run", environment)
    campaign.finish()
    return campaign.evaluations()


def ends_without_orphans(campaign: Campaign) -> bool:
    began = time.monotonic()
    while campaign.processes():
        if time.monotonic() - began > GRACE_S:
            return False
        time.sleep(0.05)
    return True


@pytest.mark.yade
@NEEDS_YADE
@pytest.mark.parametrize("moment", range(MOMENTS))
def test_kill_of_mfopt(moment: int, new_campaign: NewCampaign, undisturbed: Evaluations) -> None:
    campaign, choose = new_campaign(), random.Random(moment)
    journal, lines = campaign.directory / "journal.jsonl", choose.randint(0, len(undisturbed))
    with campaign.start() as process:
        while process.poll() is None and journal_lines(journal) < lines:
            time.sleep(0.005)
        time.sleep(choose.uniform(0.0, 0.5))
        assert process.poll() is None  # or there was nothing to kill
        process.send_signal(signal.SIGKILL)
    assert ends_without_orphans(campaign)
    campaign.finish()
    assert campaign.evaluations() == undisturbed


def test_kill_of_the_assisted_search(new_campaign: NewCampaign) -> None:
    """Results are told in the order asked, so that two workers give what was found before."""
    campaign, undisturbed = (new_campaign("numba", study=ASSISTED) for _ in range(2))
    undisturbed.finish()
    journal = campaign.directory / "journal.jsonl"
    whole = journal_lines(undisturbed.directory / "journal.jsonl")
    for share in (0.3, 0.7):
        with campaign.start() as process:
            while process.poll() is None and journal_lines(journal) < share * whole:
                time.sleep(0.005)
            assert process.poll() is None  # or there was nothing to kill
            process.send_signal(signal.SIGKILL)
        assert ends_without_orphans(campaign)
    campaign.finish()
    assert campaign.evaluations() == undisturbed.evaluations()
    levels = {level for _, level, *_ in campaign.evaluations()}
    assert levels == {"reduced", "dem-40"}
    assert campaign.insights() == undisturbed.insights() != []


@pytest.mark.yade
@NEEDS_YADE
@pytest.mark.parametrize("moment", range(MOMENTS))
def test_kill_of_a_yade_child(
    moment: int, new_campaign: NewCampaign, undisturbed: Evaluations
) -> None:
    campaign, choose = new_campaign(), random.Random(1000 + moment)
    target = choose.randint(1, 8)  # so many YADE processes are let pass; the study starts ten
    seen: set[int] = set()
    killed = False
    with campaign.start() as process:
        while process.poll() is None and not killed:
            living = yade_children(campaign)
            seen |= set(living)
            if living and len(seen) >= target:
                time.sleep(choose.uniform(0.0, 0.3))
                with contextlib.suppress(ProcessLookupError):  # it ended by itself: the next then
                    os.kill(choose.choice(living), signal.SIGKILL)
                    killed = True
            time.sleep(0.01)
        _, complaint = process.communicate(timeout=600)
    assert killed
    assert process.returncode == 0, complaint
    assert campaign.evaluations() == undisturbed


def journal_lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


def yade_children(campaign: Campaign) -> list[int]:
    found = []
    for pid in campaign.processes():
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if any(word.endswith(b"/yade") for word in words[:2]):
            found.append(pid)
    return found
