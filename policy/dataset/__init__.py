"""LeRobot datasets: reading, checking, and from joints to wrists."""
