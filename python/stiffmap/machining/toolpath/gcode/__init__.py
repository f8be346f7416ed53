"""G-code: reading to moves, writing with positions changed."""
