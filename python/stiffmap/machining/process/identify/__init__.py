"""Laws of the cutting force from measured forces."""
