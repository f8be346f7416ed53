"""Experiments from spreadsheets as workshops write them."""
