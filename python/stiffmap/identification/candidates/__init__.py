"""What might be wrong with the machine, and how each of it would show in the readings."""
