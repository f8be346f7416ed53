"""One question to the core: compile, close, solve, differentiate; `Machine` and `Solution`."""
