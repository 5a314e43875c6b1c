"""What `wholebody bench` measures."""
