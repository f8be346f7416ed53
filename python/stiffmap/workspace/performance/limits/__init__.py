"""What a requirement asks of one pose."""
