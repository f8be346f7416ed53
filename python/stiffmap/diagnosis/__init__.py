"""Which physical effect a declared machine lacks, from measured data."""

from stiffmap.diagnosis.findings import Effect
from stiffmap.diagnosis.result import Diagnosis
from stiffmap.diagnosis.verdict import diagnose

__all__ = ["Diagnosis", "Effect", "diagnose"]
