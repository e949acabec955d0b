"""The same study twice gives the same evaluations, bit for bit."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from campaigns import Campaign, new_cache


@pytest.mark.parametrize("engine", ["numba", "yade", "bullet"])
def test_same_study_twice(
    engine: str, new_campaign: Callable[..., Campaign], tmp_path: Path
) -> None:
    if engine == "yade" and shutil.which("yade") is None:
        pytest.skip("YADE is not installed")
    # Each with a cache of its own, so that the packings are settled twice too.
    first, second = (new_campaign(engine, cache=new_cache(tmp_path / name)) for name in ("a", "b"))
    first.finish()
    second.finish()
    assert len(first.evaluations()) == 3 * 4 + 2 * 4 + 2
    assert first.evaluations() == second.evaluations()
