"""The tests, folder by folder as the packages; helpers in `support`, long studies in `studies`."""
