"""Hypotheses about numbers that are not what they are called, each with its evidence; nothing is changed unasked."""
