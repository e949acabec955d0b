"""Every flawed recording is read with a note or refused with a line; none passes in silence."""

from pathlib import Path

import pytest
from recordings_corpus import CHANNELS, READ, REFUSED, Flaw, write

from calibration.recordings.case_file import read_case
from mfopt.errors import ConfigError


@pytest.mark.parametrize("flaw", READ, ids=lambda flaw: flaw.name)
def test_mended_and_said(flaw: Flaw, tmp_path: Path) -> None:
    case = read_case(write(flaw, tmp_path), CHANNELS)
    notes = " ".join(note for its in case.recordings[0].repeats for note in its.notes)
    for part in flaw.says:
        assert part in notes


@pytest.mark.parametrize("flaw", REFUSED, ids=lambda flaw: flaw.name)
def test_refused_with_the_place(flaw: Flaw, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        read_case(write(flaw, tmp_path), CHANNELS)
    for part in flaw.says:
        assert part in str(error.value)
