"""Experiment files and tables: schema, columns, units, rotations; reading and writing."""
