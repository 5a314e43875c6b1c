"""What a verdict is asked about from outside."""
