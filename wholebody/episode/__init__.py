"""The closed loop in stepped simulation, and what is measured in it.

Begin with `wholebody.episode.run.run_episode`; errors of the palms are `wholebody.episode.tracking_error`.
"""
