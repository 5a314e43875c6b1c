"""Feet that step: a walk of `wholebody.walking` as references of the controller."""
