"""Pictures of a run: the scene of an instant, the moments that count, videos, sheets and plots of a recording.

Begin with `wholebody.sim.pictures.scene.scene_at`: what there is to see, before anything is drawn.
"""
