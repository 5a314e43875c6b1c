"""Why a chunk is not done as given: causes in a sentence, what is proven of a tick, and what would do.

Begin with `wholebody.verdict.why.explainer.Explainer`; causes are found in `wholebody.verdict.why.cause`.
"""
