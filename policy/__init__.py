"""From an observation to an action chunk: specs, codecs, recorded and scripted policies. Imports numpy only."""
