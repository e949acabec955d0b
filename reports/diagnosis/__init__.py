"""HTML and PDF reports of a diagnosis."""

from reports.diagnosis.write import write_diagnosis_report

__all__ = ["write_diagnosis_report"]
