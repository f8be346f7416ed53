"""Everything that a person sees or types: commands, plots, reports, the live view, the paper's statements."""
