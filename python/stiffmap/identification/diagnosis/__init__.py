"""Which physical effect a declared machine lacks, from measured data."""

from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.identification.diagnosis.stages import diagnose

__all__ = ["Diagnosis", "Effect", "diagnose"]
