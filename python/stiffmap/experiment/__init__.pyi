from .calls import predict as predict, residual as residual, simulate as simulate
from .comparison.residual import Residual as Residual
from .experiment import Experiment as Experiment, Loop as Loop
from .files.load import load_experiment as load_experiment
from .files.save import save_experiment as save_experiment
from .prediction.predict import Predictor as Predictor
from .virtual.plans import random_plan as random_plan
