"""What a machine does over its workspace: maps, sweeps, measures, modes, design."""
