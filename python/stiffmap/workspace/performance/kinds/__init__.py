"""A file has a `MEASURE`, or the `MEASURES` of one topic; a new file here is a new measure."""
