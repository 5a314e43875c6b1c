"""What columns of datasets are, from the names of features, parts and columns.

Begin with `policy.dataset.naming.meaning.meaning`: what one name says.
"""
