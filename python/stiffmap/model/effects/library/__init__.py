"""One file per kind of effect: every module here that has an ``EFFECT`` is a kind of the library."""
