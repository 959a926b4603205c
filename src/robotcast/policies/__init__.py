"""Forward models of a cast, the datasets they learn from and the choice of an action."""
