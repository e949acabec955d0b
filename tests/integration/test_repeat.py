"""The same study twice gives the same evaluations, bit for bit, by however many workers.

Single runs of the other engines repeat too (`fidelity.test_dosing_level`).
"""

from pathlib import Path

from campaigns import STUDY, new_cache

from faults.campaign import End, complaint, new_campaign


def end_of(folder: Path, workers: int) -> End:
    """What a run comes to that settles its packings itself."""
    study = STUDY.format(engine='"numba"') + f"[run]\nworkers = {workers}\n"
    campaign = new_campaign(folder, study)
    ended = campaign.run(XDG_CACHE_HOME=str(new_cache(folder / "cache")))
    assert complaint(ended, codes=(0,)) is None
    return campaign.end()


def test_same_study_twice(tmp_path: Path) -> None:
    first, second = end_of(tmp_path / "a", 2), end_of(tmp_path / "b", 1)
    assert first == second
    assert len(first) >= 7 + 3 * 4 + 4 + 2  # starts, two levels, confirmation
