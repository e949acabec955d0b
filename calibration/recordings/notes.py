"""What was mended on reading, each note once with the files that it holds for."""

from collections.abc import Iterable

from calibration.recordings.records import Recording


def notes_by_files(recordings: Iterable[Recording]) -> list[str]:
    """Each note of the repeats once, in the order of reading: `a.csv, b.csv: NOTE`."""
    repeats = [repeat for recording in recordings for repeat in recording.repeats]
    holds_for: dict[str, list[str]] = {}
    for repeat in repeats:
        for note in dict.fromkeys(repeat.notes):
            holds_for.setdefault(note, []).append(repeat.file)
    return [
        f"all {len(files)} repeats: {note}"
        if len(files) == len(repeats) > 1
        else f"{', '.join(files)}: {note}"
        for note, files in holds_for.items()
    ]
