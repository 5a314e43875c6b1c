"""What columns of datasets are, from the names of features, parts and columns."""
