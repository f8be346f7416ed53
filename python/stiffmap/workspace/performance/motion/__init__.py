"""Drives and the tool in motion: transmission, inertia, efforts, paths, natural frequencies."""
