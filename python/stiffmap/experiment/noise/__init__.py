"""How sure a reading is: noise floor, outliers, unknown frames and zeros, whitening, model-free checks."""
