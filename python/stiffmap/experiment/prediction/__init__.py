"""What the instruments should show: one equilibrium for each different pose and wrench."""
