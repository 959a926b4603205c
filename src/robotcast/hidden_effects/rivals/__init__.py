"""What stands beside the diagnosis: cruder ways to name an effect, and one that is told it.

They ask the same `Inquiry` as the diagnosis does. None of them opens an answer; the oracle gets
what it is told from its caller.
"""
