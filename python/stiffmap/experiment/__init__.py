"""Measured data: experiments as files, prediction of every reading, residuals, virtual experiments."""

from stiffmap.experiment.experiment import Experiment, Loop
from stiffmap.experiment.load import load_experiment
from stiffmap.experiment.plans import random_plan
from stiffmap.experiment.predict import Predictor, predict
from stiffmap.experiment.residual import Residual, residual
from stiffmap.experiment.save import save_experiment
from stiffmap.experiment.simulate import simulate

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
