import os
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaigns import STUDY, Campaign, new_cache


@pytest.fixture(scope="session")
def packings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One cache of packings for all campaigns."""
    return new_cache(tmp_path_factory.mktemp("cache"))


@pytest.fixture
def new_campaign(tmp_path: Path, packings: Path) -> Iterator[object]:
    made: list[Campaign] = []

    def make(engine: str = "yade", *, cache: Path = packings, study: str = STUDY) -> Campaign:
        file = tmp_path / f"study-{engine}.toml"
        file.write_text(study.format(engine=f'"{engine}"'))
        environment = {
            **os.environ, "XDG_CACHE_HOME": str(cache), "MFOPT_TEST_MARK": uuid.uuid4().hex,
        }  # fmt: skip
        made.append(Campaign(file, tmp_path / f"run-{len(made)}", environment))
        return made[-1]

    yield make
    assert [pid for campaign in made for pid in campaign.processes()] == []
