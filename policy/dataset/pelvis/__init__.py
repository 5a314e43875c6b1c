"""Wrists recorded in each row's own pelvis: where that was, by the recorded legs, and the way to other frames."""
