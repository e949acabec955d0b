"""HTML and PDF reports of a calibration."""

from reports.calibration.write import write_calibration_report

__all__ = ["write_calibration_report"]
