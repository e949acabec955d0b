"""A run that is killed at any moment resumes to the evaluations of an undisturbed one."""

import os
import random
import shutil
import signal
import time
from collections.abc import Callable

import pytest
from campaigns import STUDY, Campaign

NewCampaign = Callable[..., Campaign]
MOMENTS = int(os.environ.get("MFOPT_KILLS", "3"))  # scripts/survive takes ten of each
GRACE_S = 10.0  # for the kernel and the keepers to end what was left

pytestmark = [
    pytest.mark.yade,
    pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed"),
]


@pytest.fixture(scope="module")
def undisturbed(
    tmp_path_factory: pytest.TempPathFactory, packings: object
) -> tuple[list[tuple[object, ...]], float]:
    path = tmp_path_factory.mktemp("undisturbed")
    (path / "study.toml").write_text(STUDY.format(engine='"yade"'))
    environment = {**os.environ, "XDG_CACHE_HOME": str(packings), "MFOPT_TEST_MARK": "undisturbed"}
    campaign = Campaign(path / "study.toml", path / "run", environment)
    began = time.monotonic()
    campaign.finish()
    return campaign.evaluations(), time.monotonic() - began


def ends_without_orphans(campaign: Campaign) -> bool:
    began = time.monotonic()
    while campaign.processes():
        if time.monotonic() - began > GRACE_S:
            return False
        time.sleep(0.05)
    return True


@pytest.mark.parametrize("moment", range(MOMENTS))
def test_kill_of_mfopt(
    moment: int, new_campaign: NewCampaign, undisturbed: tuple[list[tuple[object, ...]], float]
) -> None:
    expected, duration = undisturbed
    campaign = new_campaign()
    with campaign.start() as process:
        time.sleep(random.Random(moment).uniform(0.2, 0.95) * duration)
        process.send_signal(signal.SIGKILL)
    assert ends_without_orphans(campaign)
    campaign.finish()
    assert campaign.evaluations() == expected


@pytest.mark.parametrize("moment", range(MOMENTS))
def test_kill_of_a_yade_child(
    moment: int, new_campaign: NewCampaign, undisturbed: tuple[list[tuple[object, ...]], float]
) -> None:
    expected, duration = undisturbed
    campaign = new_campaign()
    choose = random.Random(1000 + moment)
    with campaign.start() as process:
        wait_until = time.monotonic() + choose.uniform(0.2, 0.9) * duration
        killed = False
        while process.poll() is None and not killed:
            children = yade_children(campaign) if time.monotonic() > wait_until else []
            if children:
                os.kill(choose.choice(children), signal.SIGKILL)
                killed = True
            time.sleep(0.01)
        _, complaint = process.communicate(timeout=600)
    assert killed
    assert process.returncode == 0, complaint
    assert campaign.evaluations() == expected


def yade_children(campaign: Campaign) -> list[int]:
    found = []
    for pid in campaign.processes():
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                words = file.read().split(b"\0")
        except OSError:
            continue
        if any(w.endswith(b"/yade") for w in words[:2]) and b"supervise.py" not in b" ".join(words):
            found.append(pid)
    return found
