"""The program of a tick in placo's `DynamicsSolver`."""
