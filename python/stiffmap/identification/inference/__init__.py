"""One model of a residual: noise, declared numbers, effects, smooth gaps and time share it out at once."""
