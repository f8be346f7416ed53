"""Pictures of results: functions that return a matplotlib Figure."""
