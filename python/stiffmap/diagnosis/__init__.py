"""Which physical effect a declared machine lacks, from measured data."""

from stiffmap.diagnosis.report.findings import Effect
from stiffmap.diagnosis.report.result import Diagnosis
from stiffmap.diagnosis.verdict import diagnose

__all__ = ["Diagnosis", "Effect", "diagnose"]
