"""One tick: state and reference in, joint command out."""
