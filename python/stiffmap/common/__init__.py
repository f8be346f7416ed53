"""What knows no robot: units, tables, YAML, output files, tasks, caches, errors."""
