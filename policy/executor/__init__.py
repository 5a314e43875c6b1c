"""Policies beside the control loop: latency, late answers, ensembles."""
