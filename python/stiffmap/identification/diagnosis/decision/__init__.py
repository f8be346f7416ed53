"""What may be named: shared by held-out readings, steady over the workspace, nothing left over."""
