"""What a diagnosis returns, in words, pictures and one HTML page."""
