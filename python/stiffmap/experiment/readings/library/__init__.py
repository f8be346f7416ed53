"""One file per kind of reading: every module here has a ``READING``."""
