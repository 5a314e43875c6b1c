"""Why a chunk is not done as given: causes in a sentence, what is proven of a tick, and what would do."""
