"""Mistakes of writing and mounting: units, signs, swapped gauges and loads, shifted rows; judged before any cause."""
