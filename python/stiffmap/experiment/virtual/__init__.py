"""Plans, and readings simulated for them."""
