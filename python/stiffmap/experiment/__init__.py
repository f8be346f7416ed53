"""Measured data: experiments as files, prediction of every reading, residuals, virtual experiments."""

from stiffmap.experiment.experiment import Experiment, Loop
from stiffmap.experiment.load import load_experiment
from stiffmap.experiment.predict import Predictor, predict

__all__ = ["Experiment", "Loop", "Predictor", "load_experiment", "predict"]
