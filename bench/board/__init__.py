"""Measured machines that anyone can measure again: what their authors, other packages and stiffmap reach."""
