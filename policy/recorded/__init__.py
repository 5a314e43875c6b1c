"""Chunk files, recorded motions and dataset episodes as policies.

Begin with `policy.recorded.replay.ReplayPolicy`; `policy.recorded.chunk_file` has the format of chunk files.
"""
