"""Explanations that compete with the one found, and the reading that decides between two."""
