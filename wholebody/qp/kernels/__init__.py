"""The whole-body program, compiled."""
