"""Tap tests: measured frequencies, damping and mode directions, and the effect that explains them (docs/vibration.md)."""

from stiffmap.identification.taps.explain import TapDiagnosis, explain_taps
from stiffmap.identification.taps.plan import where_to_tap
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.table import TapTest, load_taps

__all__ = ["TapDiagnosis", "TapTest", "explain_taps", "load_taps", "predict_taps", "where_to_tap"]
