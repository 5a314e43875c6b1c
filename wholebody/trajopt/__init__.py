"""The trajectory: whole-body motion along the hands' path, found for all of it at once."""
