"""Measured data: experiments as files, prediction of every reading, residuals, virtual experiments."""

from stiffmap.experiment.calls import predict, residual, simulate
from stiffmap.experiment.comparison.residual import Residual
from stiffmap.experiment.experiment import Experiment, Loop
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.files.save import save_experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.virtual.plans import random_plan

__all__ = [
    "Experiment",
    "Loop",
    "Predictor",
    "Residual",
    "load_experiment",
    "predict",
    "random_plan",
    "residual",
    "save_experiment",
    "simulate",
]
