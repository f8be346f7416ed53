"""Effects with values: fitted by least squares through the full equilibrium, with intervals."""
