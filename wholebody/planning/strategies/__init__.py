"""In what ways a chunk is planned, in which order, and which of the plans is taken."""
