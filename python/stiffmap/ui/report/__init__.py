"""What a workshop reads and signs: sentences, pages that need no server."""
