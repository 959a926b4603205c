"""Which effect is missing from a model: compare, localise, screen, confirm, next trials.

Nothing here knows cables, rigs or simulators: it sees a `Model`.
"""
