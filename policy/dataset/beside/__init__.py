"""What a dataset has beside each other: states beside actions, poses of hands beside joints."""
