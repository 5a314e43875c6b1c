"""From an action chunk to a plan: hand paths and a whole-body trajectory."""
