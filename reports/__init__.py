"""HTML and PDF reports of a run directory, whether finished, running or broken off."""

from mfopt.records.view import Describe, DesignView
from reports.write import write_report

__all__ = ["Describe", "DesignView", "write_report"]
