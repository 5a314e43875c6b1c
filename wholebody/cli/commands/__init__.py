"""Commands of `wholebody`, one file each."""
