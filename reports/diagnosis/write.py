"""Write the report of a diagnosis: one self-contained HTML file, and the same as PDF."""

from pathlib import Path

import numpy as np

from mfopt.campaign.store import RunDirectory
from mfopt.records.diagnosis import read_diagnosis
from reports.diagnosis.page import context
from reports.write import write_pages


def write_diagnosis_report(run: RunDirectory, *, html: Path, pdf: Path | None = None) -> None:
    """Write the report of a diagnosis that has ended.

    Args:
        run: its run directory, with `diagnosis.json` in it.
        html: file to write.
        pdf: file to write, or None for no PDF.

    Raises:
        ConfigError: if the diagnosis has not ended, or its result is damaged.
    """
    with np.errstate(all="ignore"):  # what overflows is shown as such
        page = context(run, read_diagnosis(run.path))
    write_pages(page, Path(__file__).parent, html, pdf)
