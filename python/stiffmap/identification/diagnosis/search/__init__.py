"""From all candidates to those that the readings demand, at a stated false-alarm rate."""
