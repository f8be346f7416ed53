"""Where the machine is commanded in each row, and absolute readings against that."""
