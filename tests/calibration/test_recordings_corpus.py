"""Every flawed recording is read with a note or refused with a line; none passes in silence."""

from pathlib import Path

import numpy as np
import pytest
from recordings_corpus import CHANNELS, READ, REFUSED, Flaw, clean, read_case, write

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


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    outcomes = set()
    for seed in range(300):
        rng, damaged = np.random.default_rng(seed), bytearray(clean().encode()[:400])
        at = int(rng.integers(len(damaged)))
        junk = bytes(rng.integers(0, 256, int(rng.integers(0, 4))).tolist())
        damaged[at : at + int(rng.integers(0, 30))] = junk
        path = write(Flaw("", {"a.csv": bytes(damaged)}, (), refused=False), tmp_path)
        try:
            read_case(path, CHANNELS)
            outcomes.add("read")
        except ConfigError as error:
            outcomes.add("refused" if "a.csv" in str(error) else "refused without the file")
    assert outcomes == {"read", "refused"}
