"""The emulators of the toy, learned once."""

import pytest
from toy_diagnosis import emulators

from surrogates.series import SeriesEmulator


@pytest.fixture(scope="session")
def learned() -> list[SeriesEmulator]:
    return emulators()
