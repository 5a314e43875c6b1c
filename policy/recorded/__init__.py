"""Chunk files, recorded motions and dataset episodes as policies."""
