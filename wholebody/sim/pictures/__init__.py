"""Pictures of a run: the scene of an instant, the moments that count, videos, sheets and plots of a recording."""
