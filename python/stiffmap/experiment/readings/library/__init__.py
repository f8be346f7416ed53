"""Kinds of readings: every `ReadingKind` of a module here is one."""
