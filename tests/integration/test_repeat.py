"""The same study twice gives the same evaluations, bit for bit.

Single runs of the other engines repeat too (`fidelity.test_dosing_level`).
"""

from pathlib import Path

from campaigns import STUDY, new_cache

from faults.campaign import End, complaint, new_campaign


def end_of(folder: Path) -> End:
    """What a run comes to that settles its packings itself."""
    campaign = new_campaign(folder, STUDY.format(engine='"numba"'))
    ended = campaign.run(XDG_CACHE_HOME=str(new_cache(folder / "cache")))
    assert complaint(ended, codes=(0,)) is None
    return campaign.end()


def test_same_study_twice(tmp_path: Path) -> None:
    first, second = end_of(tmp_path / "a"), end_of(tmp_path / "b")
    assert first == second
    assert len(first) >= 7 + 3 * 4 + 4 + 2  # starts, two levels, confirmation
