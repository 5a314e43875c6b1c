"""What a chunk asks of the robot, held against every bound of a plan, without simulating it.

Begin with `wholebody.planning.judgement.chunk_judge.ChunkJudge`; all bounds are in
`wholebody.planning.judgement.limits`.
"""
