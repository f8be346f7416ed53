"""The kinds of the library by families: the ``EFFECTS`` of every module here, or its one ``EFFECT``."""
