"""Measured against predicted: residuals, their size, and what the plan cannot determine."""
