"""The same study twice gives the same evaluations, bit for bit.

With YADE, the runs that `faults.kills` breaks off and resumes must end like an undisturbed one.
"""

from pathlib import Path

import pytest
from campaigns import STUDY, new_cache

from faults.campaign import End, complaint, new_campaign


def end_of(engine: str, folder: Path) -> End:
    """What a run comes to that settles its packings itself."""
    campaign = new_campaign(folder, STUDY.format(engine=f'"{engine}"'))
    ended = campaign.run(XDG_CACHE_HOME=str(new_cache(folder / "cache")))
    assert complaint(ended, codes=(0,)) is None
    return campaign.end()


@pytest.mark.parametrize("engine", ["numba", "bullet"])
def test_same_study_twice(engine: str, tmp_path: Path) -> None:
    first, second = end_of(engine, tmp_path / "a"), end_of(engine, tmp_path / "b")
    assert first == second
    assert len(first) >= 7 + 3 * 4 + 4 + 2  # starts, two levels, confirmation
