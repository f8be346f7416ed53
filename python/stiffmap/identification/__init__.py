"""From readings to a better machine: calibrate, diagnose, plan, tap tests, monitor."""
