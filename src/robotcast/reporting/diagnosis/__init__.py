"""The page that says which physical effect a model lacks."""
