"""What a study file may say."""

import pytest

from fidelity.scenes.dosing.objectives import Wanted
from mfopt.errors import ConfigError
from mfopt.settings import checked


def test_a_portion_without_grains_that_count_is_refused() -> None:
    # The spread leaves the last 20 out: of 20 it would be the run's duration for every design.
    with pytest.raises(ConfigError, match="reference_grains = 20 must be above 20; raise it"):
        checked(Wanted, {"reference_grains": 20}, where="s")
    checked(Wanted, {"reference_grains": 21}, where="s")
