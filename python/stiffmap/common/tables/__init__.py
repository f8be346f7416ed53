"""Tables of text and workbooks: one reader for all commands."""
