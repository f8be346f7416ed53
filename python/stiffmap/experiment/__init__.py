"""Measured data: experiments as files, prediction of every reading, residuals, virtual experiments."""

from stiffmap.common.public import attached

__getattr__, __dir__, __all__ = attached(__name__, __file__)
