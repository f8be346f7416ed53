"""One measure per file: each has a `MEASURE`; a new file here is a new measure."""
